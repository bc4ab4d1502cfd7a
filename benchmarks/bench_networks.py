"""Speed and memory of the segmentation networks on this machine, one thread.

Run: python benchmarks/bench_networks.py [--backbones pct dgcnn] [--points 1024 2048 4096]

Each row is measured in a process of its own, so that its peak memory is its own. Clouds of random
points, 4 per step; the best of the repetitions, which disturbs least what else is running. Numbers
depend on malloc: with MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=100000000000
MALLOC_TOP_PAD_=200000000, which is set here unless --plain-malloc is given, training is faster.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time

import torch
from torch import nn

from boltpose.networks.backbones import BACKBONES, build_backbone

CLASSES = 6
MALLOC = {
    "MALLOC_MMAP_MAX_": "0",
    "MALLOC_TRIM_THRESHOLD_": "100000000000",
    "MALLOC_TOP_PAD_": "200000000",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Speed:
    """One network at one size."""

    backbone: str
    parameters: int
    points: int
    half: bool
    """Whether products are in bfloat16 (autocast)."""
    train_clouds_per_s: float
    forward_clouds_per_s: float
    peak_gb: float
    """Of the whole process, torch itself included (0.35 GB)."""


def measure(backbone: str, points: int, batch: int, repetitions: int, *, half: bool) -> Speed:
    """Train and run a fresh network; CPU seconds, which other processes do not count in."""
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    torch.manual_seed(0)
    network = build_backbone(backbone, inputs=3, classes=CLASSES)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3)
    inputs, labels = torch.randn(batch, points, 3), torch.randint(CLASSES, (batch, points))

    def step() -> None:
        optimizer.zero_grad()
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=half):
            scores = network(inputs)
        nn.functional.cross_entropy(scores.float().flatten(0, 1), labels.flatten()).backward()
        optimizer.step()

    def forward() -> None:
        with torch.inference_mode(), torch.autocast("cpu", dtype=torch.bfloat16, enabled=half):
            network(inputs)

    seconds: list[float] = []
    for work in (step, forward):
        network.train(work is step)
        times: list[float] = []
        for _ in range(1 + repetitions):  # the first one warms up
            start = process_time()
            work()
            times.append(process_time() - start)
        seconds.append(min(times[1:]))
    return Speed(
        backbone=backbone,
        parameters=sum(parameter.numel() for parameter in network.parameters()),
        points=points,
        half=half,
        train_clouds_per_s=batch / seconds[0],
        forward_clouds_per_s=batch / seconds[1],
        peak_gb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,  # KB on Linux
    )


def main() -> None:
    """Measure every combination and print a table of Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--backbones", nargs="+", choices=BACKBONES, default=list(BACKBONES))
    parser.add_argument("--points", nargs="+", type=int, default=[1024, 2048, 4096])
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--plain-malloc", action="store_true", help="leave malloc as it is")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--one", help=argparse.SUPPRESS)  # a row, measured in this process
    args = parser.parse_args()
    if args.one:
        name, points, half = args.one.split(",")
        speed = measure(name, int(points), args.batch, args.repetitions, half=half == "bf16")
        print(json.dumps(asdict(speed)))
        return

    environment = os.environ | {"OMP_NUM_THREADS": "1"} | ({} if args.plain_malloc else MALLOC)
    speeds: list[Speed] = []
    print("| network | parameters | points | products | train clouds/s | forward | peak GB |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for points in args.points:
        for half in (False, True):
            reference: Speed | None = None
            for name in args.backbones:
                row = f"{name},{points},{'bf16' if half else 'float32'}"
                command = [sys.executable, __file__, "--one", row, "--batch", str(args.batch)]
                command += ["--repetitions", str(args.repetitions)]
                done = subprocess.run(
                    command, env=environment, check=True, capture_output=True, text=True
                )
                speed = Speed(**json.loads(done.stdout))
                reference = reference or speed
                print(line(speed, reference), flush=True)
                speeds.append(speed)
    if args.json:
        args.json.write_text(json.dumps([asdict(speed) for speed in speeds], indent=1) + "\n")


def line(speed: Speed, reference: Speed) -> str:
    """A row of the table; in brackets how often faster than the first network of its kind."""
    train = speed.train_clouds_per_s / reference.train_clouds_per_s
    forward = speed.forward_clouds_per_s / reference.forward_clouds_per_s
    return (
        f"| {speed.backbone} | {speed.parameters / 1e6:.2f} M | {speed.points} "
        f"| {'bf16' if speed.half else 'float32'} "
        f"| {speed.train_clouds_per_s:.2f} ({train:.2f}) "
        f"| {speed.forward_clouds_per_s:.1f} ({forward:.2f}) | {speed.peak_gb:.1f} |"
    )


if __name__ == "__main__":
    main()
