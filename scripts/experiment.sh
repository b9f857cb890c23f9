#!/usr/bin/env bash
# The experiment of RESULTS.md, from nothing: record, ingest, look, train, measure, drive, tables.
#
#   scripts/experiment.sh               everything under experiment/; a night on two cores
#   scripts/experiment.sh --out DIR     elsewhere
#   scripts/experiment.sh --quick       a few drives, systems, steps and routes: whether all of it works
#
# Stopped at any point and started again, it goes on where it was. The same seeds give the same
# tables. What the programs say is in OUT/log/. PMP_BIN is a folder with pmp's binaries; without it
# they are built.
set -euo pipefail

out="" quick=no
while [ $# -gt 0 ]; do
    case $1 in
    --out) out=${2:?--out needs a folder} && shift 2 ;;
    --quick) quick=yes && shift ;;
    -h | --help) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0" && exit 0 ;;
    *) echo "error: unknown option $1, see --help" >&2 && exit 2 ;;
    esac
done
[ -z "$out" ] || out=$(mkdir -p "$out" && cd "$out" && pwd)
cd "$(dirname "$0")/.."
out=${out:-$PWD/experiment}
mkdir -p "$out/log"

recorded=(--episodes 120 --seconds 100 --seed 5 --perturb 0.01)
steps=8000 routes=() reference=(--reference paper)
if [ "$quick" = yes ]; then
    recorded=(--episodes 10 --seconds 12 --seed 5 --perturb 0.01)
    steps=20 routes=(--suite "$out/short.toml") reference=()
    # A car that learnt nothing stands on its way until the time is over.
    cat > "$out/short.toml" << 'TOML'
version = 1
name = "short"
seed = 2020
episodes = 1
quick_episodes = 1
route_m = [50.0, 100.0]

[rules]
goal_m = 5.0
slowest_kmph = 10.0
grace_s = 20.0
off_route_m = 30.0

[[task]]
condition = "training conditions"
town = "Town03"
traffic = ["regular"]
skies = ["clear-daytime"]
TOML
fi

# One row for each system: its name, and how it is trained. Why so is said in RESULTS.md.
systems=(
    "pmp-1      --seed 1"
    "blind-1    --seed 1 --model blind"
    "pmp-2      --seed 2"
    "blind-2    --seed 2 --model blind"
    "pmp-3      --seed 3"
    "blind-3    --seed 3 --model blind"
    "cil        --seed 1 --model cil"
    "cil-r      --seed 1 --model cil-r"
    "int        --seed 1 --model int"
    "no-camera  --seed 1 --disable camera"
    "no-ralidar --seed 1 --disable ralidar"
    "no-radar   --seed 1 --disable radar"
)
if [ "$quick" = yes ]; then systems=("${systems[0]}" "${systems[1]}" "${systems[6]}"); fi
names=()
for system in "${systems[@]}"; do names+=("${system%% *}"); done

cat > "$out/training.toml" << TOML
preset = "tiny"
steps = $steps
[sampling]
balance = 0.5
[net]
action = "cut"
TOML

if [ -z "${PMP_BIN:-}" ]; then
    cargo build --release --locked --bins
    PMP_BIN=${CARGO_TARGET_DIR:-$PWD/target}/release
fi

# What has one action only has nothing to calibrate.
plans() { [[ $1 != cil* && $1 != int* ]]; }

stage=0 stages=8
for name in "${names[@]}"; do
    stages=$((stages + 2))
    ! plans "$name" || stages=$((stages + 1))
done
# step NAME COMMAND...: one line when it ends; what it says goes to the log of that name. 3 means
# done, with something left out that the report names: no reason to stop.
step() {
    local name=$1 code=0 began=$SECONDS
    shift
    stage=$((stage + 1))
    [ ! -t 2 ] || printf '\r\033[K[%2d/%d] %s ...' "$stage" "$stages" "$name" >&2
    "$@" > "$out/log/$name.out" 2> "$out/log/$name.err" || code=$?
    [ ! -t 2 ] || printf '\r\033[K' >&2
    if [ "$code" -ne 0 ] && [ "$code" -ne 3 ]; then
        printf '[%2d/%d] %s failed (%d); see %s\n' "$stage" "$stages" "$name" "$code" "$out/log/$name.err" >&2
        tail -n 5 "$out/log/$name.err" >&2
        exit 1
    fi
    printf '[%2d/%d] %s: %d min\n' "$stage" "$stages" "$name" $(((SECONDS - began + 30) / 60)) >&2
}
unless() { [ -e "$1" ] || "${@:2}"; }

step record "$PMP_BIN/pmp-sim" record --out "$out/logs" "${recorded[@]}"
step ingest "$PMP_BIN/pmp-ingest" --out "$out/data" "$out/logs"
step stats unless "$out/stats.html" "$PMP_BIN/pmp-stats" "$out/data" --html "$out/stats.html"
step check "$PMP_BIN/pmp-stats" check "$out/data" --json

for system in "${systems[@]}"; do
    read -ra words <<< "$system"
    name=${words[0]} run=$out/runs/${words[0]}
    step "train-$name" "$PMP_BIN/pmp-train" --data "$out/data" --out "$run" --resume \
        --config "$out/training.toml" "${words[@]:1}"
    ! plans "$name" || step "calibrate-$name" unless "$run/fusion.json" \
        "$PMP_BIN/pmp-eval" calibrate --policy "$run" --data "$out/data"
done

step offline unless "$out/offline/report.json" \
    "$PMP_BIN/pmp-eval" offline --policy "${names[@]/#/$out/runs/}" --data "$out/data" --out "$out/offline"

drive() { "$PMP_BIN/pmp-eval" drive "${routes[@]}" "$@"; }
step drive-known drive --policy expert oracle-plan --out "$out/driven/known"
for name in "${names[@]}"; do
    step "drive-$name" drive --policy "$out/runs/$name" --out "$out/driven/$name"
done
step drive-pmp-1-parts drive --policy "$out/runs/pmp-1" --fusion a1 a2 --out "$out/driven/pmp-1-parts"

# Seeds of one model are one system.
groups=()
for model in pmp blind; do
    seeds=$(printf '%s\n' "${names[@]}" | grep "^$model-" | paste -sd ,)
    groups+=(--group "$model=$seeds")
done
step tables "$PMP_BIN/pmp-eval" table "$out"/driven/* "${reference[@]}" "${groups[@]}"
cp "$out/log/tables.out" "$out/table.md"
echo "the table: $out/table.md; offline: $out/offline/report.html; the dataset: $out/stats.html" >&2
