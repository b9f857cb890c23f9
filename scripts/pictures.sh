#!/usr/bin/env bash
# Draw the pictures of the README anew, into docs/.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --locked --no-default-features --bin pmp-sim
sim=${CARGO_TARGET_DIR:-target}/debug/pmp-sim
maps=$(mktemp -d)
trap 'rm -rf "$maps"' EXIT
"$sim" towns --out "$maps" > /dev/null
mkdir -p docs
for town in Town03 Town07; do
    "$sim" map "$maps/$town.xodr" --picture "docs/$town.png" --scenery 0
done
"$sim" sheet --town Town03 --seed 2 --out docs/weather.png
"$sim" sheet --senses --town Town05 --seed 4 --out docs/senses.png

# The page of sixty drives as a browser shows it: on a desk, in the dark, on a phone. Takes half an hour
# of a core, a browser (chromium), and a Python with Pillow (PMP_PYTHON).
browser=$(command -v chromium || command -v google-chrome || true)
if [ -z "$browser" ]; then
    echo "pictures: skipped docs/stats.png: no chromium" >&2
    exit
fi
cargo build --locked --bins
bin=$(dirname "$sim")
"$bin/pmp-sim" record --out "$maps/logs" --episodes 60 --seconds 60 --seed 21 --perturb 0.01
"$bin/pmp-ingest" --out "$maps/sixty" "$maps/logs"
"$bin/pmp-stats" "$maps/sixty" --html "$maps/page.html" > /dev/null
shoot() { # NAME WIDTH, then flags
    "$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size="$2,2300" "${@:3}" \
        --screenshot="$maps/$1.png" "file://$maps/page.html" 2> /dev/null
}
shoot desk 1200
shoot dark 1200 --blink-settings=preferredColorScheme=0
shoot phone 500
"${PMP_PYTHON:-python3}" - "$maps" docs/stats.png <<'PY'
import sys
from PIL import Image

HEIGHT, GAP = 1150, 12
shots = [Image.open(f"{sys.argv[1]}/{name}.png").convert("RGB") for name in ("desk", "dark", "phone")]
shots = [s.resize((s.width * HEIGHT // s.height, HEIGHT), Image.Resampling.LANCZOS) for s in shots]
sheet = Image.new("RGB", (sum(s.width for s in shots) + GAP * (len(shots) - 1), HEIGHT), "#888888")
left = 0
for shot in shots:
    sheet.paste(shot, (left, 0))
    left += shot.width + GAP
sheet.quantize(256, method=Image.Quantize.MEDIANCUT).save(sys.argv[2], optimize=True)
PY
