#!/usr/bin/env bash
# Everything that has to hold before a change lands: format, lints, documentation, tests.
set -euo pipefail
cd "$(dirname "$0")/.."

# Packages to hold pmp against. Without them the tests that need them say that they skipped.
peers=${CARGO_TARGET_DIR:-$PWD/target}/peers
wanted=tests/peers/requirements.txt
if ! cmp --silent $wanted "$peers/installed.txt"; then
    rm -rf "$peers"
    if python3 -m venv "$peers" && "$peers/bin/pip" install --quiet --requirement $wanted; then
        cp $wanted "$peers/installed.txt"
    else
        echo "check: no peers from PyPI; tests that need them are skipped" >&2
    fi
fi
export PMP_PYTHON=${PMP_PYTHON:-$peers/bin/python}

cargo fmt --all --check
cargo clippy --locked --workspace --all-targets -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace --no-deps
cargo test --locked --workspace
