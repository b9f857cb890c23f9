#!/usr/bin/env bash
# Rewrite the golden texts of tests/it/golden; review the difference as you would review code.
set -euo pipefail
cd "$(dirname "$0")/.."
PMP_UPDATE_GOLDEN=1 cargo test --locked --test it -- gives_the_frames_it_gave_before read_as_they_read_before
git --no-pager diff --stat -- tests/it/golden
