"""Coloured, shaded images of point clouds at the size of a panel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, as_points
from boltpose.picture.raster import light, rasterise, shrink
from boltpose.picture.view import View
from boltpose.schema import Part

PAPER = np.array([1.0, 1.0, 1.0])
MOTOR = np.array([0.62, 0.70, 0.80])
SURROUNDINGS = np.array([0.80, 0.78, 0.74])
PRIOR = np.array([0.50, 0.68, 0.95])

PART_COLORS = {
    Part.BACKGROUND: (0.80, 0.78, 0.74),
    Part.MAIN_HOUSING: (0.45, 0.60, 0.47),
    Part.CONNECTOR: (0.62, 0.78, 0.55),
    Part.SOLENOID: (0.95, 0.72, 0.38),
    Part.ELECTRICAL_CONNECTOR: (0.93, 0.87, 0.40),
    Part.GEAR: (0.52, 0.62, 0.93),
    Part.BOLT: (0.90, 0.30, 0.28),
}
"""After the colours in the label files of the paper's group, paled so that arrows stand out."""

SUPERSAMPLING = 2
"""Images are drawn this many times finer and averaged: smooth edges."""
_MAX_POINTS = 1_000_000
"""More points than pixels show nothing more."""


def paint(view: View, points: FloatArray, colors: FloatArray) -> FloatArray:
    """Draw a lit point cloud.

    Args:
        view: From where, and the panel's size.
        points: Shape (N, 3), mm, the frame of `view.view_from_scene`.
        colors: Shape (N, 3), 0 to 1.

    Returns:
        Shape (height, width, 3), 0 to 1.
    """
    fine = replace(
        view,
        scale=view.scale * SUPERSAMPLING,
        centre=(view.centre[0] * SUPERSAMPLING, view.centre[1] * SUPERSAMPLING),
        width=view.width * SUPERSAMPLING,
        height=view.height * SUPERSAMPLING,
    )
    step = max(1, len(points) // _MAX_POINTS)
    shown, tints = points[::step], colors[::step]
    spacing_mm = _spacing_mm(shown)
    image = rasterise(fine, shown, 1.4 * spacing_mm)
    brightness = light(image, fine, smooth_mm=max(0.6, 0.9 * spacing_mm))
    tint = tints.astype(np.float32)[np.maximum(image.index, 0)]
    tint[~image.filled] = PAPER
    lit = np.where(image.filled, 0.25 + 0.85 * brightness, 1.0)
    return np.clip(shrink(tint * lit[..., None], SUPERSAMPLING), 0, 1)


def part_tints(labels: npt.NDArray[np.uint8]) -> FloatArray:
    """Colours by class; `labels` of shape (N,), returns (N, 3)."""
    table = np.array([PART_COLORS[part] for part in Part])
    return table[labels]


def distance_tints(distance_mm: FloatArray, full_mm: float) -> FloatArray:
    """Green at 0 over yellow to red at `full_mm` and beyond; shapes (N,) to (N, 3)."""
    share = np.clip(distance_mm / full_mm, 0, 1)
    stops = np.array([[0.25, 0.65, 0.35], [0.95, 0.85, 0.35], [0.80, 0.15, 0.15]])
    return np.stack([np.interp(share, (0, 0.5, 1), stops[:, c]) for c in range(3)], axis=1)


def _spacing_mm(points: FloatArray) -> float:
    """Typical distance to the fourth neighbour: the pitch of a grid, and the gaps of a scan."""
    cloud = as_points(points, "points", at_least=0)
    if len(cloud) < 5:
        return 1.0
    sample = cloud[:: max(1, len(cloud) // 2000)]
    distance, _ = KDTree(cloud).query(sample, k=5)
    return float(np.quantile(distance[:, -1], 0.9))
