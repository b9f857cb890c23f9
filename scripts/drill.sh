#!/usr/bin/env bash
# Let the expert drive the paper's twelve tasks: 4 towns x 3 levels of traffic x 18 drives.
#
#   scripts/drill.sh [ARGUMENT...]     of `pmp-sim drill`, for example --seed 1 or --json
#
# Lists the drives that did not arrive, each with its cause, then the sums of each task. About a
# minute on one core when built.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked --no-default-features --bin pmp-sim
"${CARGO_TARGET_DIR:-target}/release/pmp-sim" drill \
    --town Town03 --town Town05 --town Town06 --town Town07 "$@"
