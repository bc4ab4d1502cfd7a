"""Fit a small network in this process, and in those that torchrun or Fabric start beside it.

python -m tests.support.fit_in_processes FOLDER BATCH DEVICES
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch

from boltpose.networks.pct import Pct, PctConfig
from boltpose.training.hardware import Hardware
from boltpose.training.loop import Cloud, FitConfig, fit
from boltpose.training.weights import save_weights


def draw(rng: np.random.Generator) -> Cloud:
    """Points and the octant each is in."""
    points = rng.normal(size=(64, 3)).astype(np.float32)
    return points, ((points > 0) @ np.array([1, 2, 4])).astype(np.int64)


def main(folder: Path, batch: int, devices: int) -> None:
    """Fit, and leave log.jsonl and weights.safetensors in the folder."""
    fabric = Hardware(devices=devices).launch()
    torch.manual_seed(0)
    # no dropout: its draws belong to a process. Batch normalisation, which is shared, is there
    config = PctConfig(
        inputs=3, classes=8, channels=16, layers=1, embedding=32, head=(16, 16), dropout=0.0,
        neighbours=4,
    )  # fmt: skip
    network = Pct(config)
    recipe = FitConfig(
        steps=12, batch=batch, learning_rate=0.01, class_weights=(1, 2, 1, 1, 3, 1, 1, 1)
    )
    fit(network, draw, recipe, fabric=fabric, log=folder)
    if fabric.is_global_zero:
        save_weights(folder / "weights.safetensors", network, {})


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
