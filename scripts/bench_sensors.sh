#!/usr/bin/env bash
# Measure the simulated sensors on one core: milliseconds by sensor, steps a second, with recording.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo bench --locked --no-default-features --bench sensors
