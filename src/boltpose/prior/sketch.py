"""A prior in a few kilobytes: enough to tell which of many motors is worth a closer look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import BoolArray, Float32Array, FloatArray, freeze
from boltpose.errors import EmptyScanError
from boltpose.geometry.normals import fibonacci_directions
from boltpose.geometry.point_pairs import pair_histogram
from boltpose.geometry.sampling import voxel_representatives
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part, Prior

SKETCH_VERSION = 1
"""Counts up whenever a sketch of the same prior changes: older files are sketched anew."""
SKETCH_POINTS = 1500
"""Plane to plane, an alignment needs no more."""
SKETCH_SPACING_MM = 6.0
"""How far apart they are."""
_VOXEL_MM = 3.0
_VIEW_DIRECTIONS = 64
_VIEW_CELL_MM = 5.0
_VIEW_DEPTH_MM = 8.0
_MIN_FACING = 0.15
_SEED = 0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PriorSketch:
    """A motor's surface, coarse, in its own axes, and how its point pairs are distributed."""

    name: str
    points: Float32Array
    """Shape (K, 3), mm, frame `motor`; without the electrical connector, whose cable may lie
    elsewhere by now."""
    normals: Float32Array
    """Shape (K, 3), unit, outward."""
    pairs: Float32Array
    """Shape (`PAIR_WORDS`,), sums to 1: pairs weigh by the number of directions that see both."""
    prior_from_motor: Transform


def sketch_prior(prior: Prior) -> PriorSketch:
    """Describe a prior coarsely; the same prior gives the same bits.

    Raises:
        EmptyScanError: The prior holds fewer than two rigid points.
    """
    rigid = np.flatnonzero(prior.labels != Part.ELECTRICAL_CONNECTOR)
    if len(rigid) < 2:
        raise EmptyScanError(f"{prior.name}: found {len(rigid)} rigid points, wanted at least 2")
    rigid = rigid[voxel_representatives(prior.points[rigid], _VOXEL_MM)]
    motor_from_prior = prior.alignment.prior_from_motor.inverse()
    points = motor_from_prior.apply(prior.points[rigid])
    normals = motor_from_prior.rotate(prior.normals[rigid])
    sees = _sees(points, normals)
    chosen = np.random.default_rng(_SEED).permutation(len(points))[:SKETCH_POINTS]
    seen = sees[:, chosen].astype(np.float32)
    together = (seen.T @ seen).astype(np.float64)
    pairs = pair_histogram(points[chosen], normals[chosen], together)
    return PriorSketch(
        name=prior.name,
        points=freeze(points[chosen].astype(np.float32)),
        normals=freeze(normals[chosen].astype(np.float32)),
        pairs=freeze(pairs.astype(np.float32)),
        prior_from_motor=prior.alignment.prior_from_motor,
    )


def _sees(points: FloatArray, normals: FloatArray) -> BoolArray:
    """Which direction sees which point, (V, N), by orthographic depth buffers."""
    directions = fibonacci_directions(_VIEW_DIRECTIONS)
    sees = np.zeros((len(directions), len(points)), dtype=np.bool_)
    for row, direction in enumerate(directions):
        facing = np.flatnonzero(normals @ direction > _MIN_FACING)
        if not len(facing):
            continue
        helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
        right = np.cross(direction, helper)
        right /= np.linalg.norm(right)
        plane = np.stack([right, np.cross(direction, right)], axis=1)
        cell = np.floor(points[facing] @ plane / _VIEW_CELL_MM).astype(np.int64)
        cell -= cell.min(axis=0)
        flat = cell[:, 0] * (int(cell[:, 1].max()) + 1) + cell[:, 1]
        height = points[facing] @ direction
        front = np.full(int(flat.max()) + 1, -np.inf)
        np.maximum.at(front, flat, height)
        sees[row, facing[height > front[flat] - _VIEW_DEPTH_MM]] = True
    return sees
