"""The part of a bolt's head that can be seen from outside, and how much of it a camera saw."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, IntArray
from boltpose.factory.model import MotorModel, SolidPart, TrueBolt
from boltpose.sensor.raycast import RayCaster

SURFACE_POINTS = 500
"""Points that stand for a head's surface, as in reman18."""
SEEN_MM = 0.7
"""A surface point with a pixel of its bolt this near was seen, as in reman18."""
_CANDIDATES = 1500
_GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of the R2 sequence: its points cover a square evenly (M. Roberts, 2018)."""
_LIFT_MM = 0.02
"""Rays start that far off the surface, so as not to meet it at once."""


def sample_outer_head(bolt: TrueBolt, solid: SolidPart, count: int = SURFACE_POINTS) -> FloatArray:
    """Points evenly by area on a head's outer surface; no chance is involved.

    Outer is what a straight line away from the bolt's axis reaches without meeting the head: top
    face and flanks are, the drive's recess, the seat and the shank are not.

    Args:
        bolt: Where the head is.
        solid: Head and shank, frame `motor`.
        count: How many; what is left of a dense sampling may be a few less.

    Returns:
        Shape (N, 3), N about `count` and at most that, mm, frame `motor`.
    """
    bolt_from_motor = bolt.motor_from_bolt.inverse()
    triangles = bolt_from_motor.apply(solid.vertices)[solid.faces]
    low = -bolt.head_height_mm
    triangles = triangles[(triangles[:, :, 2] > low - 1e-3).all(axis=1)]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    flat = doubled > 1e-9
    triangles, normals = triangles[flat], normals[flat] / doubled[flat, None]
    is_seat = (normals[:, 2] < -0.7) & (triangles[:, :, 2].max(axis=1) < low + 0.2)
    points, owner = _spread(triangles[~is_seat], _CANDIDATES)
    normal = normals[~is_seat][owner]
    outward = points * (1.0, 1.0, 0.0)
    outward /= np.maximum(np.linalg.norm(outward, axis=1), 1e-9)[:, None]
    lifted = points + _LIFT_MM * normal
    is_outer = (
        ~RayCaster([solid])
        .first_hits(bolt.motor_from_bolt.apply(lifted), bolt.motor_from_bolt.rotate(outward))
        .is_hit
    )
    # a wall that looks at the axis belongs to the recess, even where a slot lets the line out
    is_outer &= np.einsum("ij,ij->i", normal, outward) > -0.5
    kept = points[is_outer]
    if len(kept) > count:
        kept = kept[np.linspace(0, len(kept) - 1, count).round().astype(np.int64)]
    return bolt.motor_from_bolt.apply(kept)


def seen_share(surface: FloatArray, measured: FloatArray) -> float:
    """Share of surface points with a measurement within `SEEN_MM`.

    Args:
        surface: Shape (N, 3), mm.
        measured: Shape (K, 3), mm, same frame; the pixels of that bolt.

    Returns:
        0 to 1; 0 for an empty surface.
    """
    if not len(surface) or not len(measured):
        return 0.0
    distance, _ = KDTree(measured).query(surface, distance_upper_bound=SEEN_MM)
    return float(np.isfinite(distance).mean())


def head_centroids(model: MotorModel) -> dict[str, FloatArray]:
    """Centre of every head's outer surface, shape (3,), mm, frame `motor`, by bolt id."""
    solids = {solid.bolt_id: solid for solid in model.parts if solid.bolt_id is not None}
    return {bolt.id: sample_outer_head(bolt, solids[bolt.id]).mean(axis=0) for bolt in model.bolts}


def _spread(triangles: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
    """Points evenly by area, shape (count, 3), and the triangle of each."""
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    ends = np.cumsum(area)
    place = (np.arange(count) + 0.5) / count * ends[-1]
    owner = np.minimum(np.searchsorted(ends, place), len(triangles) - 1)
    u, v = (np.arange(count)[:, None] * _GOLDEN % 1.0).T
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    return triangles[owner, 0] + u[:, None] * edges[owner, 0] + v[:, None] * edges[owner, 1], owner
