#!/usr/bin/env bash
# Run the notebook scripts/analysis.ipynb on a small set that is recorded first.
#
#   scripts/notebook.sh                      the result is under target/notebook/
#   scripts/notebook.sh --out DIR            elsewhere
#   scripts/notebook.sh --update             on the data that PMP_DATA, PMP_REPORT and PMP_DRIVEN name,
#                                            and keep the result as the committed copy
#
# PMP_PYTHON names a Python that has scripts/analysis.requirements.txt; without it one is made.
# PMP_BIN is a folder with pmp's binaries; without it they are built.
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-$PWD/target}

out=$target/notebook update=no
while [ $# -gt 0 ]; do
    case $1 in
    --out) out=$(mkdir -p "${2:?--out needs a folder}" && cd "$2" && pwd) && shift 2 ;;
    --update) update=yes && shift ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done

if [ -z "${PMP_PYTHON:-}" ]; then
    wanted=scripts/analysis.requirements.txt
    if ! cmp --silent $wanted "$target/analysis/installed.txt"; then
        python3 -m venv "$target/analysis"
        "$target/analysis/bin/pip" install --quiet --requirement $wanted
        cp $wanted "$target/analysis/installed.txt"
    fi
    PMP_PYTHON=$target/analysis/bin/python
fi
execute() { "$PMP_PYTHON" -m jupyter execute --timeout=600 --kernel_name=python3 "$@"; }

if [ "$update" = yes ]; then
    export PMP_DATA PMP_REPORT PMP_DRIVEN
    : "${PMP_DATA:?names no dataset}" "${PMP_REPORT:?names no report}" "${PMP_DRIVEN:?names no driven episodes}"
    execute --inplace scripts/analysis.ipynb
    exit
fi

bin=${PMP_BIN:-}
if [ -z "$bin" ]; then
    cargo build --locked --bins
    bin=$target/debug
fi

# 3 means done, with something left out that the report names: no reason to stop.
done_or_with_loss() { "$@" || [ $? -eq 3 ]; }

rm -rf "$out"
mkdir -p "$out"
"$bin/pmp-sim" record --out "$out/logs" --episodes 8 --seconds 12 --seed 5
done_or_with_loss "$bin/pmp-ingest" --out "$out/data" "$out/logs"
train() { "$bin/pmp-train" --data "$out/data" --steps 20 "$@"; }
train --out "$out/whole" --preset tiny
train --out "$out/no-camera" --preset tiny --disable camera
train --out "$out/blind" --model blind
for run in whole no-camera blind; do
    "$bin/pmp-eval" calibrate --policy "$out/$run" --data "$out/data"
done
done_or_with_loss "$bin/pmp-eval" offline --policy "$out/whole" "$out/no-camera" "$out/blind" \
    --data "$out/data" --out "$out/report"
done_or_with_loss "$bin/pmp-eval" drive --policy "$out/blind" expert --episodes 1 --out "$out/driven"

export PMP_DATA=$out/data PMP_REPORT=$out/report PMP_DRIVEN=$out/driven
cp scripts/analysis.ipynb "$out/analysis.ipynb"
(cd "$out" && execute --inplace analysis.ipynb)
echo "notebook: $out/analysis.ipynb"
