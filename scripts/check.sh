#!/usr/bin/env bash
# Everything that has to hold before a change lands: format, lints, documentation, tests, the notebook,
# and that the experiment runs from its first step to its last.
set -euo pipefail
cd "$(dirname "$0")/.."

# Packages to hold pmp against, and to run the notebook. Without them the tests that need them say
# that they skipped.
target=${CARGO_TARGET_DIR:-$PWD/target}
peers=$target/peers
wanted=(tests/peers/requirements.txt scripts/analysis.requirements.txt)
if ! cat "${wanted[@]}" | cmp --silent - "$peers/installed.txt"; then
    rm -rf "$peers"
    if python3 -m venv "$peers" &&
        "$peers/bin/pip" install --quiet "${wanted[@]/#/--requirement=}"; then
        cat "${wanted[@]}" >"$peers/installed.txt"
    else
        echo "check: no peers from PyPI; tests that need them are skipped" >&2
    fi
fi
export PMP_PYTHON=${PMP_PYTHON:-$peers/bin/python}

cargo fmt --all --check
cargo clippy --locked --workspace --all-targets -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace --no-deps
cargo test --locked --workspace

if "$PMP_PYTHON" -c "import ipykernel, matplotlib, nbclient, polars" 2>/dev/null; then
    PMP_BIN=$target/debug scripts/notebook.sh
else
    echo "check: skipped the notebook: $PMP_PYTHON has not all of scripts/analysis.requirements.txt" >&2
fi

rm -rf "$target/experiment"
PMP_BIN=$target/debug scripts/experiment.sh --quick --out "$target/experiment"
