#!/usr/bin/env python3
"""Writes PyTorch's numbers for the tests: `torch_fixtures.py FOLDER`.

Needs torch and safetensors from PyPI; made with torch 2.11.0 on a CPU. Activations are written
[B, H, W, C], as the kernels take them.
"""
import sys
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn import functional as F

folder = Path(sys.argv[1])
torch.manual_seed(1)
torch.set_num_threads(1)


def last(x):
    """[B, C, H, W] to [B, H, W, C]."""
    return x.detach().permute(0, 2, 3, 1)


def write(name, tensors):
    tensors = {key: value.detach().contiguous().float().clone() for key, value in tensors.items()}
    save_file(tensors, folder / f"{name}.safetensors")


def convolutions():
    # name: batch, height, width, channels, out, kernel, stride, padding
    cases = {
        "conv_3x3": (2, 11, 14, 16, 24, 3, 1, 1),
        "conv_3x3_stride2": (2, 9, 10, 8, 16, 3, 2, 1),
        "conv_7x7_stride2": (1, 17, 22, 3, 8, 7, 2, 3),
        "conv_1x1_stride2": (2, 7, 6, 12, 20, 1, 2, 0),
        "conv_5x3": (1, 8, 9, 4, 5, (5, 3), (1, 2), (0, 2)),
    }
    for name, (b, h, w, c, o, kernel, stride, padding) in cases.items():
        conv = nn.Conv2d(c, o, kernel, stride, padding)
        x = torch.randn(b, c, h, w, requires_grad=True)
        out = conv(x)
        grad = torch.randn_like(out)
        out.backward(grad)
        write(name, {
            "x": last(x), "weight": conv.weight, "bias": conv.bias, "out": last(out),
            "grad": last(grad), "grad_x": last(x.grad), "grad_weight": conv.weight.grad,
            "grad_bias": conv.bias.grad,
        })


def norms():
    for name, training in {"norm_train": True, "norm_eval": False}.items():
        norm = nn.BatchNorm2d(10)
        with torch.no_grad():
            norm.weight.uniform_(0.5, 2)
            norm.bias.uniform_(-1, 1)
            norm.running_mean.uniform_(-1, 1)
            norm.running_var.uniform_(0.5, 2)
        before = {"mean_before": norm.running_mean.clone(), "var_before": norm.running_var.clone()}
        norm.train(training)
        x = torch.randn(3, 10, 5, 7, requires_grad=True)
        residual = torch.randn(3, 10, 5, 7, requires_grad=True)
        out = F.relu(norm(x) + residual)
        grad = torch.randn_like(out)
        out.backward(grad)
        write(name, before | {
            "x": last(x), "residual": last(residual), "weight": norm.weight, "bias": norm.bias,
            "mean": norm.running_mean, "var": norm.running_var, "out": last(out),
            "grad": last(grad), "grad_x": last(x.grad), "grad_residual": last(residual.grad),
            "grad_weight": norm.weight.grad, "grad_bias": norm.bias.grad,
        })


def pooling():
    x = torch.randn(2, 5, 9, 12).mul(2).round().requires_grad_()
    out = F.max_pool2d(x, 3, 2, 1)
    grad = torch.randn_like(out)
    out.backward(grad)
    write("max_pool", {"x": last(x), "out": last(out), "grad": last(grad), "grad_x": last(x.grad)})


def adams():
    kinds = {
        "adam": lambda p: torch.optim.Adam([p], lr=0.01, weight_decay=0.1),
        "adamw": lambda p: torch.optim.AdamW([p], lr=0.01, weight_decay=0.1),
    }
    for name, kind in kinds.items():
        weight = torch.randn(37).requires_grad_()
        start, grads, optimizer = weight.detach().clone(), torch.randn(10, 37), kind(weight)
        steps = []
        for grad in grads:
            weight.grad = grad.clone()
            optimizer.step()
            steps.append(weight.detach().clone())
        write(name, {"start": start, "grads": grads, "steps": torch.stack(steps)})


class Block(nn.Module):
    def __init__(self, c, o, stride):
        super().__init__()
        self.conv1 = nn.Conv2d(c, o, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(o)
        self.conv2 = nn.Conv2d(o, o, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(o)
        if stride != 1 or c != o:
            conv = nn.Conv2d(c, o, 1, stride, bias=False)
            self.downsample = nn.Sequential(conv, nn.BatchNorm2d(o))

    def forward(self, x):
        shortcut = self.downsample(x) if hasattr(self, "downsample") else x
        x = F.relu(self.bn1(self.conv1(x)))
        return F.relu(self.bn2(self.conv2(x)) + shortcut)


class ResNet(nn.Module):
    def __init__(self, channels, width, depths):
        super().__init__()
        self.conv1 = nn.Conv2d(channels, width, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        c = width
        for i, depth in enumerate(depths):
            o = width << i
            strides = [2 if i > 0 and j == 0 else 1 for j in range(depth)]
            blocks = [Block(c if j == 0 else o, o, stride) for j, stride in enumerate(strides)]
            setattr(self, f"layer{i + 1}", nn.Sequential(*blocks))
            c = o

    def forward(self, x):
        x = F.max_pool2d(F.relu(self.bn1(self.conv1(x))), 3, 2, 1)
        return self.layer4(self.layer3(self.layer2(self.layer1(x)))).mean((2, 3))


def network():
    # Few channels keep the file small; the blocks are ResNet34's.
    net = ResNet(3, 4, (3, 4, 6, 3))
    with torch.no_grad():
        for name, parameter in net.named_parameters():
            if "bn" in name or "downsample.1" in name:
                parameter.uniform_(0.5, 1.5) if name.endswith("weight") else parameter.uniform_(-0.3, 0.3)
    weights = {name: value.clone() for name, value in net.state_dict().items() if value.dtype == torch.float32}
    x = torch.randn(2, 3, 61, 50, requires_grad=True)
    out = net(x)
    grad = torch.randn_like(out)
    out.backward(grad)
    tensors = {"x": last(x), "out": out, "grad": grad, "grad_x": last(x.grad)}
    tensors |= {f"weights.{name}": value for name, value in weights.items() if "running" not in name}
    tensors |= {f"grads.{name}": p.grad for name, p in net.named_parameters()}
    tensors |= {f"after.{name}": value for name, value in net.state_dict().items() if "running" in name}
    net.eval()
    with torch.no_grad():
        tensors["out_eval"] = net(x)
    write("resnet34", tensors)


for make in (convolutions, norms, pooling, adams, network):
    make()
