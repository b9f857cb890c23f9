#!/usr/bin/env bash
# Hold pmp's traffic against others: Eclipse SUMO for flow and speed, highway-env for steps a second.
#
#   scripts/bench_world.sh [--maps DIR] [--vehicles N] [--minutes M] [--rounds N]
#
# DIR holds OpenDRIVE maps (*.xodr); ../shared/maps if not given. Both yardsticks come from PyPI into
# an environment of their own. Prints tables; all that it makes lies under target/bench/.
set -euo pipefail
cd "$(dirname "$0")/.."

maps=../shared/maps vehicles=120 minutes=60 rounds=3
while [ $# -gt 0 ]; do
    case $1 in
    --maps) maps=${2:?--maps needs a folder} && shift 2 ;;
    --vehicles) vehicles=${2:?--vehicles needs a number} && shift 2 ;;
    --minutes) minutes=${2:?--minutes needs a number} && shift 2 ;;
    --rounds) rounds=${2:?--rounds needs a number} && shift 2 ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done
compgen -G "$maps/*.xodr" > /dev/null || { echo "error: no *.xodr in $maps; give a folder of maps with --maps DIR" >&2; exit 2; }

bench=target/bench
mkdir -p $bench
python=$bench/world-venv/bin/python
if [ ! -x $python ]; then
    python3 -m venv $bench/world-venv
    $bench/world-venv/bin/pip install --quiet eclipse-sumo highway-env
fi
binary=${PMP_SIM:-}
if [ -z "$binary" ]; then
    cargo build --release --locked --no-default-features --bin pmp-sim
    binary=${CARGO_TARGET_DIR:-target}/release/pmp-sim
fi
$python benches/world.py --binary "$binary" --maps "$maps" --vehicles "$vehicles" --minutes "$minutes" --rounds "$rounds" --folder $bench/world
