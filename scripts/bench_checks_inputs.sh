#!/usr/bin/env bash
# The same frames as a dataset of ours and in LeRobot's layout: what checkers of either are timed on.
#
#   scripts/bench_checks_inputs.sh DATASET OUT [FRAMES]
#
# Takes whole episodes of DATASET until there are FRAMES (10000), into OUT/pmp and OUT/lerobot.
set -euo pipefail
cd "$(dirname "$0")/.."

[ $# -ge 2 ] || { echo "usage: scripts/bench_checks_inputs.sh DATASET OUT [FRAMES]" >&2; exit 2; }
dataset=$1 out=$2 frames=${3:-10000}
stats=${PMP_STATS:-target/release/pmp-stats}
[ -x "$stats" ] || { echo "error: no $stats; cargo build --release, or name one with PMP_STATS" >&2; exit 2; }

# Episodes that are not needed any more once there are enough frames.
mapfile -t others < <(python3 - "$dataset/manifest.json" "$frames" <<'PYTHON'
import json, sys
count = 0
for log in json.load(open(sys.argv[1]))["logs"]:
    for episode in log["episodes"]:
        if count >= int(sys.argv[2]):
            print(episode["id"])
        count += episode["frames"]
PYTHON
)
if [ ${#others[@]} -gt 0 ]; then
    "$stats" drop "$dataset" --out "$out/pmp" --episode "${others[@]}"
else
    "$stats" merge "$dataset" --out "$out/pmp"
fi
"$stats" export "$out/pmp" --format lerobot --out "$out/lerobot"
