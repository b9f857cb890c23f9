#!/usr/bin/env bash
# Measure the training's loader beside a Python one on the same drive, samples per CPU second.
#
#   scripts/bench_loader.sh [--peers DIR] [--rounds N]
#
# DIR holds the yardsticks ingest_peer.py and loader_peer.py; ../shared/peers if not given. The drive
# and the environment are those of scripts/bench.sh, which has to have run before.
set -euo pipefail
cd "$(dirname "$0")/.."

peers=../shared/peers rounds=5
while [ $# -gt 0 ]; do
    case $1 in
    --peers) peers=${2:?--peers needs a folder} && shift 2 ;;
    --rounds) rounds=${2:?--rounds needs a number} && shift 2 ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done
bench=target/bench log=target/bench/drive-60.mcap
python=$bench/venv/bin/python
for file in "$log" $python "$bench/pmp-ingest-pure-rust"; do
    [ -e "$file" ] || { echo "error: no $file; run scripts/bench.sh first" >&2; exit 2; }
done

data=$bench/loader-data peer_data=$bench/loader-peer-data
[ -f $data/manifest.json ] || $bench/pmp-ingest-pure-rust --out $data "$log"
[ -d $peer_data ] || $python "$peers/ingest_peer.py" "$log" --out $peer_data --reader small --jpeg turbo-scaled
built=$(cargo bench --locked --no-default-features --features learning --bench loader --no-run --message-format=json | $python -c '
import json, sys
lines = (json.loads(line) for line in sys.stdin)
print([line["executable"] for line in lines if line.get("target", {}).get("name") == "loader" and line.get("executable")][-1])')
$python benches/loader.py --bench "$built" --data $data --peer "$peers/loader_peer.py" --peer-data $peer_data --rounds "$rounds"
