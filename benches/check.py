"""Time pmp-stats check on parts and repetitions of a dataset; see scripts/bench_check.sh.

A part is a dataset of symbolic links with a manifest of some of the logs. A repetition lists the
same shards several times under other names: its verdict has findings, its reading is real.
"""

import argparse
import copy
import json
import pathlib
import resource
import shutil
import statistics
import subprocess
import time

FRAMES = [10_000, 20_000, 40_000, 80_000]


def linked(data, folder, frames):
    """A dataset of about so many frames; the number that it has."""
    manifest = json.loads((data / "manifest.json").read_text())
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "frames").symlink_to((data / "frames").resolve())
    logs, count, turn = [], 0, 0
    while count < frames:
        log = copy.deepcopy(manifest["logs"][turn % len(manifest["logs"])])
        if turn >= len(manifest["logs"]):
            log["source_sha256"] = f"{turn}{log['source_sha256']}"
        logs.append(log)
        count += log["frames"]
        turn += 1
    manifest["logs"], manifest["frames"] = logs, count
    (folder / "manifest.json").write_text(json.dumps(manifest))
    shutil.copy(data / "episodes.parquet", folder)
    return count


def run(command):
    """Wall and CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, cpu


def measure(command, rounds):
    """Least wall time and median CPU time, ms, after one run that warms the cache."""
    run(command)
    times = [run(command) for _ in range(rounds)]
    return 1e3 * min(wall for wall, _ in times), 1e3 * statistics.median(cpu for _, cpu in times)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--command", required=True)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--doctor", type=pathlib.Path, help="lerobot-doctor")
    options = parser.parse_args()

    print("| frames | reads | wall, ms (least) | CPU, ms | CPU, us a frame |\n|---:|---|---:|---:|---:|")
    for frames in FRAMES:
        folder = options.folder / f"check-{frames}"
        count = linked(options.data, folder, frames)
        for reads, sample in [("columns", "0"), ("and 48 pictures", "48")]:
            command = [options.command, "check", str(folder), "--sample", sample]
            wall, cpu = measure(command, options.rounds)
            print(f"| {count} | {reads} | {wall:.0f} | {cpu:.0f} | {1e3 * cpu / count:.2f} |", flush=True)
    if options.doctor:
        exported = options.folder / f"check-{FRAMES[0]}-lerobot"
        shutil.rmtree(exported, ignore_errors=True)
        export = ["export", str(options.folder / f"check-{FRAMES[0]}"), "--format", "lerobot", "--out", str(exported)]
        subprocess.run([options.command, *export], stdout=subprocess.DEVNULL, check=True)
        count = json.loads((exported / "meta" / "info.json").read_text())["total_frames"]
        wall, cpu = measure([str(options.doctor), str(exported)], options.rounds)
        print(f"| {count} | lerobot-doctor, the same frames | {wall:.0f} | {cpu:.0f} | {1e3 * cpu / count:.2f} |")


main()
