#!/usr/bin/env bash
# The whole path, from a driving log to a table: record, ingest, look, train, evaluate.
#
#   scripts/demo.sh                    on drives that pmp records itself
#   scripts/demo.sh LOG...             on your own MCAP logs
#   scripts/demo.sh --out DIR [LOG...] elsewhere than demo/
#
# Stopped at any point and started again, it goes on where it was.
set -euo pipefail

out=""
if [ "${1:-}" = "--out" ]; then
    out=${2:?--out needs a folder}
    mkdir -p "$out"
    out=$(cd "$out" && pwd)
    shift 2
fi
logs=()
for log in "$@"; do
    [ -e "$log" ] || { echo "error: no such log: $log" >&2; exit 2; }
    logs+=("$(cd "$(dirname "$log")" && pwd)/$(basename "$log")")
done

cd "$(dirname "$0")/.."
out=${out:-$PWD/demo}
steps=${PMP_DEMO_STEPS:-300}

# 3 means done, with something left out that the report names: no reason to stop.
done_or_with_loss() { "$@" || [ $? -eq 3 ]; }
say() { printf '\n== %s\n' "$*" >&2; }

say "build"
cargo build --locked --bins
bin=${CARGO_TARGET_DIR:-$PWD/target}/debug

if [ ${#logs[@]} -eq 0 ]; then
    if [ ! -d "$out/logs" ]; then
        say "record: six drives of 40 s on a plain road"
        rm -rf "$out/logs.part"
        "$bin/pmp-sim" record --out "$out/logs.part" --episodes 6 --seconds 40 --seed 1
        mv "$out/logs.part" "$out/logs"
    fi
    logs=("$out/logs")
fi

say "ingest: logs to a dataset of aligned frames"
done_or_with_loss "$bin/pmp-ingest" --out "$out/dataset" "${logs[@]}"

say "stats: what is in the dataset"
"$bin/pmp-stats" "$out/dataset"

say "train: the tiny network, $steps steps"
resume=()
[ -e "$out/run" ] && resume=(--resume)
"$bin/pmp-train" --data "$out/dataset" --out "$out/run" --preset tiny --steps "$steps" "${resume[@]}"

say "evaluate: on frames that were not trained on"
if [ ! -e "$out/report/report.json" ]; then
    done_or_with_loss "$bin/pmp-eval" offline --policy "$out/run" --data "$out/dataset" \
        --out "$out/report"
else
    "$bin/pmp-eval" table "$out/report"
fi
say "the table again: $out/report/table.md; a picture of it: $out/report/speed.svg"
