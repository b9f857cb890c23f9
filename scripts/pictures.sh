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
