"""pmp's loader beside the peer on one drive; called by scripts/bench_loader.sh.

Both read the drive as each stores it and make shuffled batches of 600 x 250 pictures with lidar and
radar as floats. They take turns; rates are samples per CPU second, medians over the rounds.
"""

import argparse
import os
import pathlib
import re
import statistics
import subprocess
import sys


def run(command, pattern, **options):
    environment = {**os.environ, "RAYON_NUM_THREADS": "1", "CANDLE_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, **options)
    if done.returncode != 0:
        sys.exit(f"error: {' '.join(map(str, command))}\n{done.stderr}")
    samples, cpu_s = re.search(pattern, done.stdout).groups()
    return int(samples) / float(cpu_s)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bench", type=pathlib.Path, required=True, help="the built benches/loader.rs")
    parser.add_argument("--data", type=pathlib.Path, required=True, help="dataset of the drive")
    parser.add_argument("--peer", type=pathlib.Path, required=True, help="loader_peer.py")
    parser.add_argument("--peer-data", type=pathlib.Path, required=True, help="the peer's Parquet files of the drive")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    shards = sorted(options.peer_data.rglob("*.parquet"))
    theirs = [sys.executable, options.peer.resolve(), *(shard.resolve() for shard in shards)]
    programs = {
        "pmp": lambda: run([options.bench.resolve(), options.data.resolve(), "250", "600"], r"samples (\d+) cpu_s ([\d.]+)"),
        "Python, OpenCV, numpy, no workers": lambda: run(theirs, r": (\d+) samples,.*cpu ([\d.]+) s"),
    }
    rates = {name: [] for name in programs}
    for _ in range(options.rounds):
        for name, program in programs.items():
            rates[name].append(program())
    peer = statistics.median(rates["Python, OpenCV, numpy, no workers"])
    print("| loader | samples per CPU-s | to the peer |\n|---|---:|---:|")
    for name, values in rates.items():
        print(f"| {name} | {statistics.median(values):.0f} | {statistics.median(values) / peer:.2f} |")


if __name__ == "__main__":
    main()
