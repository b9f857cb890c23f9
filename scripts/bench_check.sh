#!/usr/bin/env bash
# Measure pmp-stats check: milliseconds a dataset, without and with pictures, by number of frames.
#
#   scripts/bench_check.sh [--data DATASET] [--rounds N]
#
# DATASET is one that pmp-ingest made; without it six drives are recorded and ingested first
# (minutes). Parts of it and repetitions of it are datasets of symbolic links under target/bench/.
# Beside it lerobot-doctor (PyPI) on the smallest of them, exported (pmp-stats export).
set -euo pipefail
cd "$(dirname "$0")/.."

data='' rounds=7
while [ $# -gt 0 ]; do
    case $1 in
    --data) data=${2:?--data needs a folder} && shift 2 ;;
    --rounds) rounds=${2:?--rounds needs a number} && shift 2 ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done

bench=target/bench
mkdir -p $bench
bin=${CARGO_TARGET_DIR:-target}/release
cargo build --release --locked --no-default-features --features checks --bin pmp-stats
if [ -z "$data" ]; then
    data=$bench/check-data
    if [ ! -f $data/manifest.json ]; then
        cargo build --release --locked --no-default-features --bin pmp-sim --bin pmp-ingest
        "$bin/pmp-sim" record --out $bench/check-logs --episodes 6
        "$bin/pmp-ingest" --out $data $bench/check-logs
    fi
fi
venv=$bench/check-venv
if [ ! -x $venv/bin/lerobot-doctor ]; then
    python3 -m venv $venv
    $venv/bin/pip install --quiet lerobot-doctor==0.2.0
fi
python3 benches/check.py --command "$bin/pmp-stats" --data "$data" --rounds "$rounds" --folder $bench \
    --doctor $venv/bin/lerobot-doctor
