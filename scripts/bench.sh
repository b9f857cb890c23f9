#!/usr/bin/env bash
# Measure pmp, each part beside others that do the same job.
#
#   scripts/bench.sh [WHAT] [OPTIONS]      options are those of WHAT; see scripts/bench_WHAT.sh
#
#   ingest    pmp-ingest beside Python tools: same log, same run, CPU seconds; the default, see below
#   train     a training step and a policy's pass beside PyTorch: CPU time, wall time, memory
#   loader    the training's loader beside a Python one: samples per CPU second (after ingest)
#   sensors   the simulated sensors: milliseconds by sensor, steps a second
#   check     pmp-stats check: milliseconds a dataset, by frames
#   world     the traffic beside SUMO (flow, speed) and highway-env (steps a second)
#   all       all of these, one after the other, without options
#
#   scripts/bench.sh ingest [--peers DIR] [--seconds N] [--rounds N]
#
# DIR holds the yardsticks make_bag.py (writes the log) and ingest_peer.py (does the job with the
# PyPI packages mcap or small-mcap, libjpeg-turbo, numpy and pyarrow); ../shared/peers if not given.
# Needs libturbojpeg0 for the peers, cmake and nasm for pmp's feature turbojpeg (Debian's packages).
# Prints the tables of the README; all that it makes lies under target/bench/.
set -euo pipefail
cd "$(dirname "$0")/.."

case ${1:-} in
ingest) shift ;;
train | loader | sensors | check | world) what=$1 && shift && exec "scripts/bench_$what.sh" "$@" ;;
all)
    [ $# -eq 1 ] || { echo "error: all takes no options; see --help" >&2; exit 2; }
    for what in ingest train loader sensors check world; do "$0" $what; done
    exit ;;
esac

peers=../shared/peers seconds=60 rounds=5
while [ $# -gt 0 ]; do
    case $1 in
    --peers) peers=${2:?--peers needs a folder} && shift 2 ;;
    --seconds) seconds=${2:?--seconds needs a number} && shift 2 ;;
    --rounds) rounds=${2:?--rounds needs a number} && shift 2 ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done
for file in make_bag.py ingest_peer.py; do
    [ -f "$peers/$file" ] || { echo "error: no $peers/$file; give the yardsticks with --peers DIR" >&2; exit 2; }
done
for tool in cmake nasm; do
    command -v $tool > /dev/null || { echo "error: $tool is needed to build libjpeg-turbo: apt-get install cmake nasm" >&2; exit 2; }
done

bench=target/bench
mkdir -p $bench
python=$bench/venv/bin/python
if [ ! -x $python ]; then
    python3 -m venv $bench/venv
    $bench/venv/bin/pip install --quiet numpy opencv-python-headless mcap mcap-ros2-support small-mcap rosbags pyarrow 'PyTurboJPEG<2'
fi
log=$bench/drive-$seconds.mcap
if [ ! -f "$log" ]; then
    $python "$peers/make_bag.py" "$log.part" --seconds "$seconds"
    mv "$log.part" "$log"
fi
for features in pure-rust turbojpeg; do
    flags=(--release --locked --no-default-features --bin pmp-ingest)
    [ $features = pure-rust ] || flags+=(--features turbojpeg)
    cargo build "${flags[@]}"
    cp "${CARGO_TARGET_DIR:-target}/release/pmp-ingest" $bench/pmp-ingest-$features
done
$python benches/ingest.py --log "$log" --peer "$peers/ingest_peer.py" --rounds "$rounds" --folder $bench
