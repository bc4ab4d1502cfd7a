"""Point clouds for the tests of readers: motor-sized, reproducible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Cloud:
    """A small organised cloud of float32-exact numbers, rows x columns, without holes."""

    points: np.ndarray
    colors: np.ndarray
    normals: np.ndarray
    labels: np.ndarray
    shape: tuple[int, int]


def make_cloud(rows: int = 5, columns: int = 8, *, seed: int = 0) -> Cloud:
    rng = np.random.default_rng(seed)
    count = rows * columns
    points = rng.uniform(-200, 200, (count, 3)).astype(np.float32).astype(np.float64)
    return Cloud(
        points=points,
        colors=rng.integers(0, 256, (count, 3)).astype(np.uint8),
        normals=rng.normal(size=(count, 3)).astype(np.float32).astype(np.float64),
        labels=rng.integers(0, 7, count).astype(np.uint8),
        shape=(rows, columns),
    )
