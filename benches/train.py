#!/usr/bin/env python3
"""A training step and a policy's pass beside PyTorch's: `train.py BENCH [options]`.

Runs the benchmark program BENCH (`benches/train.rs`) and this file in turns, each in its own
process, and prints medians and ratios as a Markdown table. Needs torch and safetensors from PyPI.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# height, width, batch, channels of the first stage, numbers of a feature
SIZES = {"tiny": (64, 160, 16, 16, 256), "mid": (88, 200, 8, 64, 2048), "full": (250, 600, 2, 64, 2048)}
MODES, STEPS, ROUTE = 6, 6, 260


def peak_mb():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024


def network(width, feature):
    from torch import nn
    from torch.nn import functional as F
    import torch

    class Block(nn.Module):
        def __init__(self, c, o, stride):
            super().__init__()
            self.conv1 = nn.Conv2d(c, o, 3, stride, 1, bias=False)
            self.bn1 = nn.BatchNorm2d(o)
            self.conv2 = nn.Conv2d(o, o, 3, 1, 1, bias=False)
            self.bn2 = nn.BatchNorm2d(o)
            self.downsample = None
            if stride != 1 or c != o:
                conv = nn.Conv2d(c, o, 1, stride, bias=False)
                self.downsample = nn.Sequential(conv, nn.BatchNorm2d(o))

        def forward(self, x):
            shortcut = x if self.downsample is None else self.downsample(x)
            x = F.relu(self.bn1(self.conv1(x)), inplace=True)
            return F.relu(self.bn2(self.conv2(x)) + shortcut, inplace=True)

    class ResNet34(nn.Module):
        def __init__(self, channels):
            super().__init__()
            self.conv1 = nn.Conv2d(channels, width, 7, 2, 3, bias=False)
            self.bn1 = nn.BatchNorm2d(width)
            c = width
            for stage, depth in enumerate((3, 4, 6, 3)):
                o = width << stage
                blocks = []
                for i in range(depth):
                    blocks.append(Block(c, o, 2 if stage > 0 and i == 0 else 1))
                    c = o
                setattr(self, f"layer{stage + 1}", nn.Sequential(*blocks))
            self.fc = nn.Linear(c, feature)

        def forward(self, x):
            x = F.relu(self.bn1(self.conv1(x)), inplace=True)
            x = F.max_pool2d(x, 3, 2, 1)
            x = self.layer4(self.layer3(self.layer2(self.layer1(x))))
            return F.relu(self.fc(x.mean((2, 3))))

    class Two(nn.ModuleList):
        def __init__(self, a, b, c):
            super().__init__([nn.Linear(a, b), nn.Linear(b, c)])

        def forward(self, x):
            return self[1](F.relu(self[0](x)))

    class Net(nn.Module):
        def __init__(self):
            super().__init__()
            self.camera, self.ralidar = ResNet34(3), ResNet34(4)
            self.route, self.velocity = Two(ROUTE, 512, feature), Two(2, 512, feature)
            self.attention = nn.Linear(feature, 1)
            self.action = Two(feature, 256, 3)
            self.motion = Two(feature, 256, MODES * (1 + 4 * STEPS))

        def forward(self, camera, ralidar, route, velocity):
            features = [self.camera(camera), self.ralidar(ralidar),
                        F.relu(self.route(route)), F.relu(self.velocity(velocity))]
            features = torch.stack(features, 1)
            weights = torch.softmax(self.attention(features), 1)
            fused = (features * weights).sum(1)
            return self.action(fused), self.motion(fused)

    return Net()


def loss_of(action, motion, true_action, true_motion):
    import math
    import torch
    logits = torch.log_softmax(motion[:, :MODES], 1)
    mean, log_std = motion[:, MODES:].reshape(-1, MODES, 4 * STEPS).split(2 * STEPS, 2)
    off = (true_motion[:, None] - mean) * torch.exp(-log_std)
    each = (-0.5 * off ** 2 - log_std - 0.5 * math.log(2 * math.pi)).sum(2)
    likelihood = torch.logsumexp(logits + each, 1).mean()
    return (action - true_action).abs().mean() - 0.1 * likelihood


def write(folder, size, batch):
    """Weights and a batch for both."""
    import torch
    from safetensors.torch import save_file
    height, width, full_batch, channels, feature = SIZES[size]
    batch = batch or full_batch
    torch.manual_seed(0)
    net = network(channels, feature)
    state = {name: value for name, value in net.state_dict().items() if value.dtype == torch.float32}
    save_file(state, folder / "weights.safetensors")
    save_file({
        "camera": torch.randn(batch, height, width, 3), "ralidar": torch.randn(batch, height, width, 4),
        "route": torch.randn(batch, ROUTE), "velocity": torch.randn(batch, 2),
        "action": torch.randn(batch, 3), "motion": torch.randn(batch, 2 * STEPS),
    }, folder / "batch.safetensors")


def measure(folder, mode, layout, threads, warm, steps):
    """What the benchmark program does, in PyTorch."""
    import torch
    from safetensors.torch import load_file
    torch.set_num_threads(threads)
    start = peak_mb()
    weights, batch = (load_file(folder / f"{name}.safetensors") for name in ("weights", "batch"))
    net = network(weights["camera.conv1.weight"].shape[0], weights["camera.fc.weight"].shape[0])
    net.load_state_dict(weights, strict=False)
    del weights
    for name in ("camera", "ralidar"):
        batch[name] = batch[name].permute(0, 3, 1, 2).contiguous()
        if layout == "last":
            batch[name] = batch[name].contiguous(memory_format=torch.channels_last)
    if layout == "last":
        net = net.to(memory_format=torch.channels_last)
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-4)
    net.train(mode == "train")
    inputs = [batch[name] for name in ("camera", "ralidar", "route", "velocity")]
    base = peak_mb()

    def step():
        if mode == "forward":
            with torch.inference_mode():
                return net(*inputs)[0].sum().item()
        optimizer.zero_grad()
        loss = loss_of(*net(*inputs), batch["action"], batch["motion"])
        loss.backward()
        optimizer.step()
        return loss.item()

    losses = [step() for _ in range(warm)]
    clock, used = time.perf_counter(), time.process_time()
    losses += [step() for _ in range(steps)]
    cpu, wall = (time.process_time() - used) / steps, (time.perf_counter() - clock) / steps
    print(json.dumps({"cpu": cpu, "wall": wall, "start": start, "base": base, "peak": peak_mb(), "losses": losses}))


def check(options):
    """The gradient of each parameter beside PyTorch's: the difference's norm over its norm."""
    import torch
    from safetensors.torch import load_file
    for size in options.sizes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            write(folder, size, None)
            subprocess.run([options.bench, folder, "gradients", "2", "0", "0"], check=True)
            ours = load_file(folder / "gradients.safetensors")
            weights, batch = (load_file(folder / f"{name}.safetensors") for name in ("weights", "batch"))
        found = {}
        for kind in (torch.float32, torch.float64):
            net = network(*SIZES[size][3:]).to(kind)
            net.load_state_dict(weights, strict=False)
            inputs = [batch[name].permute(0, 3, 1, 2) for name in ("camera", "ralidar")]
            inputs = [x.to(kind) for x in (*inputs, batch["route"], batch["velocity"])]
            loss_of(*net(*inputs), batch["action"].to(kind), batch["motion"].to(kind)).backward()
            found[kind] = {name: p.grad for name, p in net.named_parameters()}

        def off(some, others):
            each = {}
            for name, other in others.items():
                if name != "attention.bias":  # softmax does not see it: its gradient is 0 but for rounding
                    each[name] = ((some[name] - other).norm() / other.norm()).item()
            worst = sorted(each, key=each.get)[::-1]
            return f"median {statistics.median(each.values()):.1e}, worst " + ", ".join(f"{each[n]:.1e} {n}" for n in worst[:3])
        single, double = found[torch.float32], found[torch.float64]
        print(f"{size}: ours to PyTorch {off(ours, single)}\n  ours to f64 {off(ours, double)}\n"
              f"  PyTorch to f64 {off(single, double)}")


def compare(options):
    print("| size | what | threads | ours: CPU s | wall s | MB | PyTorch: CPU s | wall s | MB "
          "| channels last: CPU s | wall s | CPU ratio | wall ratio | memory ratio |")
    print("|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    notes = []
    for size in options.sizes.split(","):
        for what in options.what.split(","):
            mode, batch = ("train", None) if what == "train" else ("forward", 1 if what == "latency" else None)
            with tempfile.TemporaryDirectory() as folder:
                subprocess.run([sys.executable, __file__, "--write", folder, size, str(batch or 0)], check=True)
                for threads in (int(n) for n in options.threads.split(",")):
                    row(options, Path(folder), size, what, mode, threads, notes)
    print(*notes, sep="\n")


def row(options, folder, size, what, mode, threads, notes):
    warm, steps = 1, {"train": options.steps, "forward": 3 * options.steps, "latency": 10 * options.steps}[what]
    if size == "tiny":
        steps *= 4
    rest = [str(threads), str(warm), str(steps)]
    commands = {
        "ours": [options.bench, str(folder), mode, *rest],
        "first": [sys.executable, __file__, "--measure", str(folder), mode, "first", *rest],
        "last": [sys.executable, __file__, "--measure", str(folder), mode, "last", *rest],
    }
    runs = {name: [] for name in commands}
    for turn in range(options.rounds):
        order = list(commands)[turn % 3:] + list(commands)[:turn % 3]
        for name in order:
            environment = os.environ | {"CANDLE_NUM_THREADS": str(threads)}
            output = subprocess.run(
                commands[name], check=True, capture_output=True, text=True, env=environment).stdout
            runs[name].append(json.loads(output.splitlines()[-1]))
    # Memory over what the process has before it has a network: the interpreter and its packages.
    for results in runs.values():
        for result in results:
            result["memory"] = result["peak"] - result["start"]
            result["over_base"] = result["peak"] - result["base"]

    def median(name, key):
        return statistics.median(result[key] for result in runs[name])

    def ratio(key):
        of = (statistics.median(ours[key] / max(theirs[key], 1e-9) for ours, theirs in zip(runs["ours"], runs[name]))
              for name in ("first", "last"))
        return " / ".join(f"{x:.2f}" for x in of)

    cells = [size, what, threads]
    cells += [f"{median('ours', 'cpu'):.4f}", f"{median('ours', 'wall'):.4f}", f"{median('ours', 'memory'):.0f}"]
    cells += [f"{median('first', 'cpu'):.4f}", f"{median('first', 'wall'):.4f}", f"{median('first', 'memory'):.0f}"]
    cells += [f"{median('last', 'cpu'):.4f}", f"{median('last', 'wall'):.4f}"]
    cells += [ratio("cpu"), ratio("wall"), ratio("memory")]
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    first = {name: ", ".join(f"{x:.5f}" for x in results[0]["losses"][:3]) for name, results in runs.items()}
    notes.append(f"\n{size} {what}, {threads} threads: ours {first['ours']}; PyTorch {first['first']}, "
                 f"channels last {first['last']}; memory over network and batch: ratio {ratio('over_base')}")


def main():
    if sys.argv[1] == "--write":
        return write(Path(sys.argv[2]), sys.argv[3], int(sys.argv[4]) or None)
    if sys.argv[1] == "--measure":
        folder, mode, layout, *numbers = sys.argv[2:]
        return measure(Path(folder), mode, layout, *map(int, numbers))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bench", help="the program of benches/train.rs")
    parser.add_argument("--sizes", default="tiny,mid,full")
    parser.add_argument("--what", default="train,forward,latency", help="latency: forward, one frame")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=2, help="measured in each round, after one before")
    parser.add_argument("--check", action="store_true", help="gradients beside PyTorch's, no times")
    options = parser.parse_args()
    (check if options.check else compare)(options)


main()
