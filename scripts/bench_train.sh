#!/usr/bin/env bash
# Measure a training step of the paper's network, and a policy's pass, beside PyTorch on the CPU:
# the same weights, the same batch, in turns; CPU time, wall time, memory.
#
#   scripts/bench_train.sh [--sizes tiny,mid,full] [--what train,forward,latency] [--threads 1,2] [--rounds N] [--steps N]
#   scripts/bench_train.sh --check [--sizes ..]     gradients of every parameter beside PyTorch's, in f32 and f64
#
# Needs Python 3.9 or newer; PyTorch comes from PyPI, into target/bench/. Prints Markdown.
set -euo pipefail
cd "$(dirname "$0")/.."

case ${1:-} in -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;; esac
venv=target/bench/torch
if [ ! -x $venv/bin/python ]; then
    mkdir -p target/bench
    python3 -m venv $venv
    $venv/bin/pip install --quiet torch==2.11.0 safetensors numpy
fi
built=$(cargo bench --locked --no-default-features --features learning --bench train --no-run --message-format=json | python3 -c '
import json, sys
lines = (json.loads(line) for line in sys.stdin)
print([line["executable"] for line in lines if line.get("target", {}).get("name") == "train" and line.get("executable")][-1])')
$venv/bin/python benches/train.py "$built" "$@"
