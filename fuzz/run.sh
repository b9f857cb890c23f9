#!/usr/bin/env bash
# Fuzz the readers of foreign bytes: MCAP, CDR, ROS 1, protobuf, JSON, point clouds, JPEG.
#
#   fuzz/run.sh [SECONDS [TARGET...]]    all targets, 600 s each, one after the other
#
# Needs `cargo install cargo-fuzz`. What is found lies in fuzz/artifacts/; put it, repaired, into
# fuzz/corpus/TARGET/, which `cargo test` runs. Growing corpora stay in fuzz/grown/, not committed.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(mcap cdr ros1 protobuf json cloud jpeg)

# No sanitizer: pmp has no unsafe code, so panics, hangs and memory are what there is to find.
# The coverage that the fuzzer needs is unstable in name only.
export RUSTC_BOOTSTRAP=1
cargo fuzz build -s none "${targets[@]:0:1}" >&2
for target in "${targets[@]}"; do
    mkdir -p "fuzz/grown/$target"
    cargo fuzz run -s none "$target" "fuzz/grown/$target" "fuzz/corpus/$target" -- \
        -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=1200 \
        -max_len=65536 -print_final_stats=1 2>&1 | tail -n 12
done
