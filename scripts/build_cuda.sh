#!/usr/bin/env bash
# Build pmp-train and pmp-eval for NVIDIA's GPUs, on a machine that need not have one.
#
#   scripts/build_cuda.sh [--cap N] [--keep-build] [--clean] [-- CARGO-OPTIONS]
#
# --cap N        compute capability that kernels are compiled for: 80 (Ampere) if not given. They are
#                kept as PTX, which a driver compiles further for its own GPU: N or newer.
# --keep-build   keep what cargo made in between (about 1 GB), for the next build to be quick
# --clean        delete all that this script has made, and do nothing else
#
# Needs Python 3.9 or newer, a C and a C++ compiler (gcc 7 to 15), 4 GB of disk and about a quarter
# of an hour of CPU time. NVIDIA's compiler and libraries come from PyPI, pinned to CUDA 13.0; a
# CUDA of the system is not used. All lies under target/cuda/: toolkit/, build/, bin/.
#
# The programs need a driver of CUDA 13 (libcuda.so.1, 580 or newer) and the toolkit's libraries:
#
#   LD_LIBRARY_PATH=target/cuda/toolkit/lib target/cuda/bin/pmp-train --device cuda --data DATASET --out RUN
#
# Elsewhere the libraries come from a CUDA 13 of that machine, or from PyPI's nvidia-cublas,
# nvidia-curand, nvidia-cuda-nvrtc and nvidia-cuda-runtime. Without a driver the programs do not
# even start: keep those of `cargo build` for machines that have none.
set -euo pipefail
cd "$(dirname "$0")/.."

cap=80 keep=false here=$PWD/target/cuda
while [ $# -gt 0 ]; do
    case $1 in
    --cap) cap=${2:?--cap needs a number, such as 90} && shift 2 ;;
    --keep-build) keep=true && shift ;;
    --clean) rm -rf "$here" && exit 0 ;;
    --) shift && break ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done
case $cap in
*[!0-9]* | '') echo "error: --cap is a number without a point, such as 80 or 90, not $cap" >&2 && exit 2 ;;
esac

# Pinned together: a compiler and headers of different releases do not fit.
wheels=(nvidia-cuda-nvcc==13.0.88 nvidia-cuda-crt==13.0.88 nvidia-nvvm==13.0.88
    nvidia-cuda-cccl==13.0.85 nvidia-cuda-runtime==13.0.96 nvidia-cuda-nvrtc==13.0.88
    nvidia-cublas==13.1.0.3 nvidia-curand==10.4.0.35)
toolkit=$here/toolkit
if [ "$(cat "$here/wheels.txt" 2> /dev/null)" != "${wheels[*]}" ]; then
    echo "fetching NVIDIA's compiler and libraries from PyPI (0.6 GB)" >&2
    rm -rf "$here/venv" "$toolkit"
    mkdir -p "$here"
    python3 -m venv "$here/venv"
    "$here/venv/bin/pip" install --quiet --disable-pip-version-check --no-cache-dir --no-deps "${wheels[@]}"
    # The wheels of CUDA 13 make up one root; what it lacks of a toolkit is names for the linker.
    mv "$here"/venv/lib/python3*/site-packages/nvidia/cu13 "$toolkit"
    rm -rf "$here/venv"
    ln -sfn lib "$toolkit/lib64"
    for library in "$toolkit"/lib/lib*.so.*; do
        case $library in *.alt.*) continue ;; esac
        ln -sf "$(basename "$library")" "${library%%.so.*}.so"
    done
    echo "${wheels[*]}" > "$here/wheels.txt"
fi

flags=(--locked --no-default-features --features cuda)
# The driver comes with the machine that has the GPU. For the linker a library with its name and
# the functions that cudarc declares is enough.
stubs=$toolkit/lib/stubs
if [ ! -f "$stubs/libcuda.so" ]; then
    mkdir -p "$stubs"
    cargo metadata --format-version 1 "${flags[@]}" | python3 -c '
import json, pathlib, re, sys
packages = json.load(sys.stdin)["packages"]
[cudarc] = [p["manifest_path"] for p in packages if p["name"] == "cudarc"]
text = (pathlib.Path(cudarc).parent / "src/driver/sys/mod.rs").read_text()
names = sorted(set(re.findall(r"\bfn (cu[A-Z]\w*)\(", text)))
assert "cuInit" in names, "cudarc declares its driver functions in another way"
for name in names:
    print(f"int {name}(void) {{ return 999; }}")
' > "$stubs/cuda.c"
    cc -shared -fPIC -Wl,-soname,libcuda.so.1 -o "$stubs/libcuda.so" "$stubs/cuda.c"
fi

export CUDA_HOME=$toolkit CUDA_ROOT=$toolkit CUDA_PATH=$toolkit CUDA_COMPUTE_CAP=$cap
export NVCC=$toolkit/bin/nvcc PATH=$toolkit/bin:$PATH CARGO_TARGET_DIR=$here/build
export RUSTFLAGS="${RUSTFLAGS:-} -L native=$toolkit/lib"
cargo build --release "${flags[@]}" --bin pmp-train --bin pmp-eval "$@"
mkdir -p "$here/bin"
for program in pmp-train pmp-eval; do
    cp "$here/build/release/$program" "$here/bin/"
done
$keep || rm -rf "$here/build"
echo "made target/cuda/bin/pmp-train and pmp-eval for compute capability $cap and newer" >&2
echo "run them with LD_LIBRARY_PATH=target/cuda/toolkit/lib; see scripts/build_cuda.sh --help" >&2
