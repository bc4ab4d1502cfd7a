"""Coloured, shaded images of point clouds at the size of a panel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import Float32Array, FloatArray, as_points
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
_MANY_POINTS = 50_000
_ENOUGH_POINTS = 500
_COLUMN_MM = (8.0, 40.0)
"""Columns of the scene in which the spacing of many points is measured: width, and to the next."""


def paint(view: View, points: FloatArray, colors: FloatArray) -> FloatArray:
    """Draw a lit point cloud.

    Args:
        view: From where, and the panel's size.
        points: Shape (N, 3), mm, the frame of `view.view_from_scene`.
        colors: Shape (N, 3), 0 to 1.

    Returns:
        Shape (height, width, 3), 0 to 1.
    """
    return shrink(paint_finely(view, points, colors, SUPERSAMPLING), SUPERSAMPLING)


def paint_finely(
    view: View, points: FloatArray, colors: FloatArray, factor: int, *, contrast: float = 0.85
) -> Float32Array:
    """Draw a lit point cloud with more dots than the view has.

    Args:
        view: From where.
        points: Shape (N, 3), mm, the frame of `view.view_from_scene`.
        colors: Shape (N, 3), 0 to 1.
        factor: Dots per pixel of the view, in each direction.
        contrast: How much light and shade change the colours; less where a colour is a number.

    Returns:
        Shape (factor * height, factor * width, 3), 0 to 1.
    """
    fine = replace(
        view,
        scale=view.scale * factor,
        centre=(view.centre[0] * factor, view.centre[1] * factor),
        width=view.width * factor,
        height=view.height * factor,
    )
    if not len(points):
        return np.ones((fine.height, fine.width, 3), dtype=np.float32)
    step = max(1, len(points) // _MAX_POINTS)
    shown, tints = points[::step], colors[::step]
    spacing_mm = typical_spacing_mm(shown)
    image = rasterise(fine, shown, 1.4 * spacing_mm)
    brightness = light(image, fine, smooth_mm=max(0.6, 0.9 * spacing_mm))
    tint = tints.astype(np.float32)[np.maximum(image.index, 0)]
    tint[~image.filled] = PAPER
    lit = np.where(image.filled, 1.10 - contrast * (1 - brightness), 1.0)
    return np.clip(tint * lit[..., None], 0, 1).astype(np.float32)


def part_tints(labels: npt.NDArray[np.uint8]) -> FloatArray:
    """Colours by class; `labels` of shape (N,), returns (N, 3)."""
    table = np.array([PART_COLORS[part] for part in Part])
    return table[labels]


def distance_tints(distance_mm: FloatArray, full_mm: float) -> FloatArray:
    """Green at 0 over yellow to red at `full_mm` and beyond; shapes (N,) to (N, 3)."""
    share = np.clip(distance_mm / full_mm, 0, 1)
    stops = np.array([[0.25, 0.65, 0.35], [0.95, 0.85, 0.35], [0.80, 0.15, 0.15]])
    return np.stack([np.interp(share, (0, 0.5, 1), stops[:, c]) for c in range(3)], axis=1)


def typical_spacing_mm(points: FloatArray) -> float:
    """Typical distance to the fourth neighbour: the pitch of a grid, and the gaps of a scan.

    Args:
        points: Shape (N, 3), mm.
    """
    cloud = as_points(points, "points", at_least=0)
    if len(cloud) < 5:
        return 1.0
    if len(cloud) > _MANY_POINTS:
        # a tree of columns of the scene, not of all of it: ten times as fast
        beside = np.mod(cloud[:, :2], _COLUMN_MM[1])
        column = cloud[(beside < _COLUMN_MM[0]).all(axis=1)]
        inner = np.mod(column[:, :2], _COLUMN_MM[1])
        rim = _COLUMN_MM[0] / 4
        inside = column[((inner > rim) & (inner < _COLUMN_MM[0] - rim)).all(axis=1)]
        if len(inside) >= _ENOUGH_POINTS:
            spacing_mm = _fourth_neighbour_mm(column, inside)
            if spacing_mm < rim:
                return spacing_mm
    return _fourth_neighbour_mm(cloud, cloud)


def _fourth_neighbour_mm(cloud: FloatArray, asked: FloatArray) -> float:
    sample = asked[:: max(1, len(asked) // 2000)]
    distance, _ = KDTree(cloud).query(sample, k=5)
    return float(np.quantile(distance[:, -1], 0.9))
