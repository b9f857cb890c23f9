"""Outputs and gradients of pmp's networks by PyTorch: makes tests/fixtures/torch/*.json.

    PMP_EXPORT=DIR cargo test --test it -- --ignored networks_are_exported
    python tests/peers/torch_networks.py DIR tests/fixtures/torch

Needs torch, numpy and safetensors from PyPI. Networks are written down here by names of weights,
apart from pmp's own code, and computed in f64. Of each gradient the fixture holds its norm, its sum,
some entries, and how far PyTorch's own f32 is off: backward through 34 layers with batch norm, where
a rounding decides which ReLUs are open, that can be two per cent.
"""

import json
import pathlib
import sys

import torch
import torch.nn.functional as F
from safetensors.torch import load_file

EPS = 1e-5

# Version 2.15 dies in oneDNN's f32 convolutions of few channels.
torch.backends.mkldnn.enabled = False


def batch_norm(x, w, name):
    """Normalised by the batch, as in training."""
    return F.batch_norm(x, None, None, w[f"{name}.weight"], w[f"{name}.bias"], training=True, eps=EPS)


def resnet34(x, w, name):
    x = F.relu(batch_norm(F.conv2d(x, w[f"{name}.conv1.weight"], stride=2, padding=3), w, f"{name}.bn1"))
    x = F.max_pool2d(x, 3, 2, 1)
    for stage, blocks in enumerate((3, 4, 6, 3)):
        for block in range(blocks):
            at = f"{name}.layer{stage + 1}.{block}"
            stride = 2 if stage > 0 and block == 0 else 1
            y = F.relu(batch_norm(F.conv2d(x, w[f"{at}.conv1.weight"], stride=stride, padding=1), w, f"{at}.bn1"))
            y = batch_norm(F.conv2d(y, w[f"{at}.conv2.weight"], padding=1), w, f"{at}.bn2")
            if f"{at}.downsample.0.weight" in w:
                x = batch_norm(F.conv2d(x, w[f"{at}.downsample.0.weight"], stride=stride), w, f"{at}.downsample.1")
            x = F.relu(x + y)
    return x.mean((2, 3))


def stack(x, w, name, kernels):
    """Convolutions of (stride, padding), then all that is left, channels last."""
    for i, (stride, padding) in enumerate(kernels):
        bias = w.get(f"{name}.conv{i}.bias")
        x = F.conv2d(x, w[f"{name}.conv{i}.weight"], bias, stride=stride, padding=padding)
        x = F.relu(x if bias is not None else batch_norm(x, w, f"{name}.norm{i}"))
    return x.permute(0, 2, 3, 1).flatten(1)


def encode(x, w, name, encoder, layers):
    x = x.permute(0, 3, 1, 2)
    if encoder == "resnet34":
        return resnet34(x, w, name)
    if encoder == "cil":
        return stack(x, w, name, [(s, 0) for s in (2, 1, 2, 1, 2, 1, 1, 1)])
    return stack(x, w, name, [(2, 1)] * layers)


def dense(x, w, name):
    i = 0
    while f"{name}.fc{i}.weight" in w:
        x = F.linear(F.relu(x) if i > 0 else x, w[f"{name}.fc{i}.weight"], w[f"{name}.fc{i}.bias"])
        i += 1
    return x


def scaled(data):
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    units = torch.tensor([50.0, 50.0, 50.0, 20.0])
    camera = (data["camera"] - mean) / std if "camera" in data else None
    ralidar = data["ralidar"] / units if "ralidar" in data else None
    return camera, ralidar, data["velocity"] / 12.0, data["route"] / 26.0


def action(raw):
    return torch.cat([torch.tanh(raw[:, :1]), torch.sigmoid(raw[:, 1:])], 1)


def pmp(w, data, net):
    camera, ralidar, velocity, route = scaled(data)
    picture = net["picture"]
    encoder, layers = picture["encoder"], len(picture["channels"])
    features = []
    for name, x in (("camera", camera), ("ralidar", ralidar)):
        if name not in net["disable"]:
            features.append(F.relu(dense(encode(x, w, name, encoder, layers), w, name)))
    features.append(F.relu(dense(velocity, w, "velocity")))
    features.append(F.relu(dense(route, w, "route")))
    joint = torch.cat(features, 1)
    attention = torch.softmax(dense(joint, w, "attention"), 1)
    fused = sum(f * attention[:, i : i + 1] for i, f in enumerate(features))
    raw, k = dense(joint, w, "gmm"), net["modes"]
    mean, log_std = raw[:, k : k + 60 * k].reshape(-1, k, 30, 2), raw[:, k + 60 * k :].reshape(-1, k, 30, 2)
    low, high = torch.log(torch.tensor(0.01)), torch.log(torch.tensor(5.0))
    centre, half = (low + high) / 2, (high - low) / 2
    log_std = centre + half * torch.tanh((log_std - centre) / half)
    return action(dense(fused, w, "action")), (raw[:, :k], mean, log_std), None


def cil(w, data, net):
    camera, _, _, _ = scaled(data)
    picture = net["picture"]
    image = F.relu(dense(encode(camera, w, "image", picture["encoder"], len(picture["channels"])), w, "image"))
    speed = data["velocity"].norm(dim=1, keepdim=True) / 12.0
    joint = torch.cat([image, F.relu(dense(speed, w, "velocity"))], 1)
    joint = F.relu(dense(joint, w, "joint"))
    names = ("follow", "left", "right", "straight")
    branches = torch.stack([dense(joint, w, f"branch.{name}") for name in names], 1)
    raw = branches[torch.arange(len(joint)), data["command"].long()]
    return action(raw), None, dense(image, w, "speed")


def int_net(w, data, net):
    camera, _, velocity, route = scaled(data)
    image = F.relu(dense(encode(camera, w, "camera", net["picture"]["encoder"], 0), w, "camera"))
    parts = [image, F.relu(dense(velocity, w, "velocity")), F.relu(dense(route, w, "route"))]
    return action(dense(torch.cat(parts, 1), w, "action")), None, None


def loss_of(outputs, data):
    act, motion, speed = outputs
    total = (act - data["action"]).abs().mean()
    if motion is not None:
        logits, mean, log_std = motion
        target = (data["motion"] / torch.tensor([10.0, 1.0])).unsqueeze(1)
        log_prob = torch.distributions.Normal(mean, log_std.exp()).log_prob(target).sum((2, 3))
        nll = -torch.logsumexp(torch.log_softmax(logits, 1) + log_prob, 1)
        total = total + 0.1 * nll.mean() / 60.0
    if speed is not None:
        now = data["velocity"].norm(dim=1, keepdim=True) / 12.0
        total = total + 0.05 * (speed - now).abs().mean()
    return total


def differentiate(net, weights, data, dtype):
    """Outputs, loss, and flat gradients by name."""
    torch.set_default_dtype(dtype)
    weights = {n: v.to(dtype).requires_grad_("running" not in n) for n, v in weights.items()}
    data = {n: v.to(dtype) for n, v in data.items()}
    outputs = {"pmp": pmp, "cil": cil, "int": int_net}[net["structure"]](weights, data, net)
    total = loss_of(outputs, data)
    total.backward()
    return outputs, total, {n: v.grad.flatten() for n, v in weights.items() if v.grad is not None}


def main():
    source, target = map(pathlib.Path, sys.argv[1:3])
    target.mkdir(parents=True, exist_ok=True)
    names = sys.argv[3:] or sorted(path.name.removesuffix(".config.json") for path in source.glob("*.config.json"))
    for name in names:
        path = source / f"{name}.config.json"
        net = json.loads(path.read_text())["net"]
        tensors = [load_file(source / f"{name}.{what}.safetensors") for what in ("weights", "data")]
        outputs, total, gradients = differentiate(net, *tensors, torch.float64)
        _, _, rounded = differentiate(net, *tensors, torch.float32)
        summaries = {}
        for parameter, flat in sorted(gradients.items()):
            some = [int(i) for i in torch.linspace(0, len(flat) - 1, min(5, len(flat)))]
            off = (rounded[parameter].double() - flat).norm() / flat.norm().clamp(min=1e-30)
            summaries[parameter] = {
                "norm": flat.norm().item(),
                "sum": flat.sum().item(),
                "entries": [[i, flat[i].item()] for i in some],
                "f32_off": off.item(),
            }
        act, motion, speed = outputs
        fixture = {"torch": torch.__version__, "loss": total.item(), "action": act.tolist(), "gradients": summaries}
        if motion is not None:
            fixture["mean"] = motion[1][:, :, ::10].flatten().tolist()
        if speed is not None:
            fixture["speed"] = speed.flatten().tolist()
        (target / f"{name}.json").write_text(json.dumps(fixture, indent=1) + "\n")
        worst = max(summary["f32_off"] for summary in summaries.values())
        print(f"{name}: loss {total.item():.6f}, {len(summaries)} gradients, PyTorch's f32 off by up to {worst:.1e}")


if __name__ == "__main__":
    main()
