"""pmp-ingest beside its peers on one log; called by scripts/bench.sh, which makes the log.

The programs take turns, so that a slow minute of the machine is everybody's. Rates are frames with
3 s of future per CPU second (user + system), medians over the rounds; memory is the largest
resident set. That all make the same frames is checked: their number, and the pictures.
"""

import argparse
import collections
import io
import json
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import time

import numpy
import pyarrow.dataset
from cv2 import IMREAD_COLOR, imdecode

# Symbols of the profile, by what they are at work on; the first that fits.
STAGES = [
    ("JPEG decoding", r"picture::jpeg_|pulp::|zune_jpeg|jdhuff|jsimd_(idct|h2v\d_(fancy_)?upsample|ycc)|decode_mcu|^tj.*[dD]ecomp|jpeg_idct|decompress_onepass|h2v\d_fancy"),
    ("JPEG encoding", r"jpeg_encoder|jsimd_(fdct|huff|h2v\d_down|quant|rgb|extrgb|conv)|encode_mcu|forward_DCT|compress_data"),
    ("scaling", r"fast_image_resize"),
    ("checksums", r"sha2|crc32"),
    ("writing Parquet", r"dataset::(halves|columns)|parquet|arrow|bytes::|ZSTD_comp|HUF_comp|ZSTD_enc|doubleFast|CTable|PlainEncoder"),
    ("decompressing chunks", r"ZSTD|HUF_|FSE_|^0x|LZ4"),
    ("reading files, memory", r"^\[k\]|mem(move|set|cpy)|malloc|_int_free|^_copy"),
    ("alignment, projection, labels", r"pmp::|sort"),
]


def run(command, **options):
    """CPU seconds, wall seconds, largest resident set in MB, and what was printed."""
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    printed = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        sys.exit(f"error: {' '.join(map(str, command))}\n{printed}")
    cpu = usage.ru_utime + usage.ru_stime
    return cpu, time.perf_counter() - begin, usage.ru_maxrss / 1e3, printed


def pmp(binary, log, out, jobs):
    shutil.rmtree(out, ignore_errors=True)
    measured = run([binary, "--out", out, "--jobs", str(jobs), log])
    manifest = json.loads((out / "manifest.json").read_text())
    frames = sum(entry["frames_with_full_future"] for entry in manifest["logs"])
    return frames, *measured[:3]


def peer(script, log, out, reader, jpeg):
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, script.name, log.resolve(), "--out", out.resolve(), "--reader", reader, "--jpeg", jpeg]
    *measured, printed = run(command, cwd=script.parent)
    return int(re.search(r": (\d+) frames", printed)[1]), *measured


def psnr(a, b):
    picture = lambda data: imdecode(numpy.frombuffer(data, numpy.uint8), IMREAD_COLOR).astype(float)
    return 10 * numpy.log10(255**2 / numpy.mean((picture(a) - picture(b)) ** 2))


def compare_frames(ours, theirs):
    """PSNR of our stored pictures against the peer's, and the share of occupied lidar and radar
    pixels that both have, where both took the same three recorded messages."""
    columns = ["stamp", "image", "image_skew", "lidar_skew", "radar_skew", "lidar_pixel", "radar_pixel"]
    table = pyarrow.dataset.dataset(ours / "frames", partitioning="hive").to_table(columns=columns)
    frames = {}
    for stamp, row in zip(table["stamp"].cast("int64").to_pylist(), table.drop_columns("stamp").to_pylist()):
        skews = [row[f"{name}_skew"] for name in ("image", "lidar", "radar")]
        if None not in skews:
            frames[tuple(stamp + skew for skew in skews)] = row
    columns = ["t_ns", "dt_cam", "dt_lidar", "dt_radar", "image", "rl_idx"]
    levels, shares = [], []
    for row in pyarrow.dataset.dataset(theirs).to_table(columns=columns).to_pylist():
        own = frames.get(tuple(row["t_ns"] + row[name] for name in ("dt_cam", "dt_lidar", "dt_radar")))
        if own is None:
            continue
        pixels, peers = set(own["lidar_pixel"]) | set(own["radar_pixel"]), set(row["rl_idx"])
        shares.append(len(pixels & peers) / len(pixels | peers))
        if len(shares) % 10 == 1:
            levels.append(psnr(own["image"], row["image"]))
    return len(shares), levels, shares


def profile(binary, log, folder):
    """Shares of the CPU time by stage, if `perf` is there."""
    if not shutil.which("perf"):
        return None
    data, out = folder / "perf.data", folder / "profiled"
    shutil.rmtree(out, ignore_errors=True)
    run(["perf", "record", "-q", "-F", "500", "-o", data, binary, "--out", out, "--jobs", "1", log])
    report = run(["perf", "report", "-i", data, "--no-children", "-g", "none", "--sort", "sym", "--stdio"])[3]
    shares = collections.Counter()
    for line in io.StringIO(report):
        found = re.match(r"\s+(\d+\.\d+)%\s+(\[[.k]\])\s+(.*)", line)
        if found:
            symbol = found[3].strip() if found[2] == "[.]" else "[k] " + found[3]
            stage = next((name for name, pattern in STAGES if re.search(pattern, symbol)), "the rest")
            shares[stage] += float(found[1])
    return shares


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--log", type=pathlib.Path, required=True)
    parser.add_argument("--peer", type=pathlib.Path, required=True)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    options = parser.parse_args()
    log, folder = options.log, options.folder
    binary = lambda features: (folder / f"pmp-ingest-{features}").resolve()
    programs = {
        "pmp-ingest, feature turbojpeg": lambda out: pmp(binary("turbojpeg"), log, out, 1),
        "pmp-ingest": lambda out: pmp(binary("pure-rust"), log, out, 1),
        "pmp-ingest, feature turbojpeg, 2 jobs": lambda out: pmp(binary("turbojpeg"), log, out, 2),
        "Python, small-mcap, libjpeg-turbo at 1/2": lambda out: peer(options.peer, log, out, "small", "turbo-scaled"),
        "Python, mcap, libjpeg-turbo": lambda out: peer(options.peer, log, out, "mcap", "turbo"),
    }
    results = {name: [] for name in programs}
    for round_ in range(options.rounds):
        for name, program in programs.items():
            results[name].append(program(folder / f"out-{list(programs).index(name)}"))
            frames, cpu, wall, memory = results[name][-1]
            print(f"round {round_ + 1}: {name}: {frames} frames, {cpu:.2f} CPU-s, {wall:.2f} s, {memory:.0f} MB", file=sys.stderr)

    rate = {name: statistics.median(frames / cpu for frames, cpu, *_ in rows) for name, rows in results.items()}
    best = max(value for name, value in rate.items() if name.startswith("Python"))
    megabytes = log.stat().st_size / 1e6
    print(f"\n{log.name}: {megabytes:.0f} MB, {options.rounds} rounds\n")
    print("| program | frames per CPU-s | to the best peer | frames/s | MB/s | memory, MB |\n|---|---|---|---|---|---|")
    for name, rows in results.items():
        wall = statistics.median(row[2] for row in rows)
        memory = max(row[3] for row in rows)
        frames = rows[0][0]
        print(f"| {name} | {rate[name]:.0f} | {rate[name] / best:.2f} | {frames / wall:.0f} | {megabytes / wall:.0f} | {memory:.0f} |")
    for index, name in enumerate(list(programs)[:2]):
        same, levels, shares = compare_frames(folder / f"out-{index}", folder / "out-3")
        print(
            f"\n{name}: {same} frames took the messages that the peer took; PSNR between the pictures, median "
            f"{statistics.median(levels):.1f} dB, least {min(levels):.1f} dB; occupied pixels that both have, median "
            f"{100 * statistics.median(shares):.2f} %, least {100 * min(shares):.2f} %"
        )
    shares = profile(binary("turbojpeg"), log, folder)
    if shares:
        print("\n| where the time goes (feature turbojpeg) | share |\n|---|---|")
        for stage, share in shares.most_common():
            print(f"| {stage} | {share:.0f} % |")
    else:
        print("\nno profile: `perf` is not there", file=sys.stderr)


main()
