#!/usr/bin/env bash
# The whole path, from a driving log to a table: record, ingest, look, train, evaluate, drive.
#
#   scripts/demo.sh                    on drives that pmp records itself
#   scripts/demo.sh LOG...             on your own MCAP logs
#   scripts/demo.sh --out DIR [LOG...] elsewhere than demo/
#   scripts/demo.sh --steps N [LOG...] a longer training than 300 steps
#
# Stopped at any point and started again, it goes on where it was.
set -euo pipefail

out="" steps=300
while [ $# -gt 0 ]; do
    case $1 in
    --out) out=${2:?--out needs a folder} && shift 2 ;;
    --steps) steps=${2:?--steps needs a number} && shift 2 ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    -*) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    *) break ;;
    esac
done
[ -z "$out" ] || out=$(mkdir -p "$out" && cd "$out" && pwd)
logs=()
for log in "$@"; do
    [ -e "$log" ] || { echo "error: no such log: $log" >&2; exit 2; }
    logs+=("$(cd "$(dirname "$log")" && pwd)/$(basename "$log")")
done

cd "$(dirname "$0")/.."
out=${out:-$PWD/demo}

# 3 means done, with something left out that the report names: no reason to stop.
done_or_with_loss() { "$@" || [ $? -eq 3 ]; }
say() { printf '\n== %s\n' "$*" >&2; }

say "build"
cargo build --locked --bins
bin=${CARGO_TARGET_DIR:-$PWD/target}/debug

is_own_town=$([ ${#logs[@]} -eq 0 ] && echo yes || echo no)
if [ "$is_own_town" = yes ]; then
    say "record: six drives of 40 s in towns"
    "$bin/pmp-sim" record --out "$out/logs" --episodes 6 --seconds 40 --seed 1
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
say "the table again: $out/report/table.md; as a page: $out/report/report.html"

# What learned from another camera than the simulator's has nothing to look for in it.
if [ "$is_own_town" = yes ]; then
    say "calibrate: how far the network's plans are to be followed"
    "$bin/pmp-eval" calibrate --policy "$out/run" --data "$out/dataset" --force

    say "drive: one route in each town and traffic of DeepTest, beside the expert"
    done_or_with_loss "$bin/pmp-eval" drive --policy "$out/run" expert --episodes 1 \
        --out "$out/driven-$steps"
    say "the table again: $out/driven-$steps/table.md; failures: $out/driven-$steps/failures"
fi
