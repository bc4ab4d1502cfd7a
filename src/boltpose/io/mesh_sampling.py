"""Turn a CAD mesh into the scan that a hand-held scanner would make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.errors import ConfigError
from boltpose.geometry.normals import fibonacci_directions
from boltpose.io.guard import MAX_POINTS
from boltpose.io.mesh import MeshPart
from boltpose.io.part_names import match_part_names
from boltpose.schema import Part, Scan

_VIEW_COUNT = 64
"""Of evenly spread directions, one is within 15 degrees of any normal."""
_OVERSAMPLING = 8
"""Points that make the depth images, per point of the scan."""
_CELL_PER_SPACING = 1.4
"""Pixels hold 16 of those points on average; one in ten million is empty by chance."""
_MIN_FACING = 0.8
"""Cosine of the steepest view under which a point counts as seen."""
_DEPTH_PER_CELL = 1.1
"""So much can a surface that steep fall off inside one pixel: sqrt(2) tan(acos(0.8)) = 1.06."""


def sample_mesh(
    parts: Sequence[MeshPart],
    names_to_part: Mapping[str, Part] | None = None,
    *,
    spacing_mm: float = 1.0,
    rng: np.random.Generator,
    keep_hidden: bool = False,
) -> Scan:
    """Sample points evenly over the outer surface of a CAD model.

    Args:
        parts: The model, in place.
        names_to_part: Name or fnmatch pattern to class; without it the scan has no labels.
        spacing_mm: Each point stands for a square of this side. 1 mm is what the full scans of
            hand-held scanners have.
        rng: The source of randomness.
        keep_hidden: Keep surfaces that no direction sees from outside, such as the shanks of
            bolts inside the housing. A scanner never sees them. Leaving them out also costs a
            few points, within about 1.5 spacings, in sharp inner edges.

    Returns:
        The scan in mm, in the model's frame, with unit normals out of the material and, where
        names are mapped, labels.

    Raises:
        ConfigError: A part matches no name, or `spacing_mm` is not positive or gives more points
            than any scan has.
    """
    if not spacing_mm > 0:
        raise ConfigError(f"spacing_mm must be > 0, got {spacing_mm}")
    classes = None
    if names_to_part is not None:
        classes = match_part_names([part.name for part in parts], names_to_part)
    triangles = np.concatenate([part.vertices[part.faces] for part in parts])
    owner = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    edges = triangles[:, 1:] - triangles[:, :1]
    crosses = np.cross(edges[:, 0], edges[:, 1])
    doubled_areas = np.linalg.norm(crosses, axis=1)
    area_mm2 = float(doubled_areas.sum()) / 2
    count = round(area_mm2 / spacing_mm**2)
    if not 3 <= count * _OVERSAMPLING <= MAX_POINTS:
        raise ConfigError(
            f"spacing_mm {spacing_mm:g} gives {count} points on {area_mm2:.4g} mm2, "
            f"wanted 3 to {MAX_POINTS // _OVERSAMPLING}"
        )
    chosen = _spread(doubled_areas, count * _OVERSAMPLING, rng)
    weights = _barycentric(len(chosen), rng)
    points = triangles[chosen, 0] + np.einsum("nk,nkd->nd", weights, edges[chosen])
    normals = crosses[chosen] / doubled_areas[chosen][:, None]
    # every so many-th of evenly spread points are evenly spread too
    kept = np.arange(0, len(chosen), _OVERSAMPLING)
    if not keep_hidden:
        kept = kept[_is_seen(points, kept, normals[kept], spacing_mm * _CELL_PER_SPACING)]
    labels = None
    if classes is not None:
        labels = np.array(classes, dtype=np.uint8)[owner[chosen[kept]]]
    return Scan(points=points[kept], normals=normals[kept], labels=labels, source="mesh")


def _spread(weights: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Draw `count` indices in proportion to weights, at equal steps: evener than by chance."""
    positions = (np.arange(count) + rng.random()) / count
    cumulated = np.cumsum(weights)
    index = np.searchsorted(cumulated, positions * cumulated[-1], side="right")
    return np.minimum(index, int(np.flatnonzero(weights)[-1])).astype(np.int64)


def _barycentric(count: int, rng: np.random.Generator) -> FloatArray:
    """Draw uniform points of a triangle as shares, shape (count, 2), of its two edges."""
    shares = rng.random((count, 2))
    is_outside = shares.sum(axis=1) > 1
    shares[is_outside] = 1 - shares[is_outside]
    return shares


def _is_seen(points: FloatArray, asked: IntArray, normals: FloatArray, cell_mm: float) -> BoolArray:
    """Tell which points some direction sees in front of all others.

    Args:
        points: Shape (N, 3), mm; all of them hide what is behind.
        asked: Shape (M,), the points that are asked about.
        normals: Shape (M, 3), unit, outward, of the points asked about.
        cell_mm: Edge of a pixel of the orthographic depth images.

    Returns:
        Shape (M,).

    Source:
        Depth buffer as in `boltpose.geometry.normals.orient_outward`.
    """
    is_seen = np.zeros(len(asked), dtype=np.bool_)
    for direction in fibonacci_directions(_VIEW_COUNT):
        helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
        right = np.cross(direction, helper)
        right /= np.linalg.norm(right)
        plane = np.stack([right, np.cross(direction, right)], axis=1)
        pixels = np.floor((points @ plane) / cell_mm).astype(np.int64)
        pixels -= pixels.min(axis=0)
        flat = pixels[:, 0] * (pixels[:, 1].max() + 1) + pixels[:, 1]
        height = points @ direction
        front = np.full(int(flat.max()) + 1, -np.inf)
        np.maximum.at(front, flat, height)
        is_facing = normals @ direction > _MIN_FACING
        behind = front[flat[asked]] - height[asked]
        is_seen |= is_facing & (behind < _DEPTH_PER_CELL * cell_mm)
    return is_seen
