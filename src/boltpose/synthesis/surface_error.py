"""How far points are off the solids they were measured on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray
from boltpose.factory.model import SolidPart
from boltpose.sensor.raycast import RayCaster

_SAMPLES_PER_MM2 = 1.0
_NEIGHBOURS = 4
_REACH_MM = 0.8
"""Errors below this are measured by rays, larger ones to the nearest sample."""


def signed_errors_mm(points: FloatArray, solids: Sequence[SolidPart]) -> FloatArray:
    """Distances from the surface along its normal, outside positive.

    Args:
        points: Shape (N, 3), mm, frame of the solids.
        solids: What was measured.

    Returns:
        Shape (N,), mm; exact where the surface is smooth and the error below `_REACH_MM`.
    """
    samples, normals = _samples(solids)
    found = KDTree(samples).query(points, k=_NEIGHBOURS)
    distance, near = np.asarray(found[0]), np.asarray(found[1])
    side = np.sum((points - samples[near[:, 0]]) * normals[near[:, 0]], axis=1)
    result = np.where(side < 0, -distance[:, 0], distance[:, 0])
    caster = RayCaster(solids)
    best = np.maximum(distance[:, 0], _REACH_MM)
    # the nearest sample may lie on a face inside a joint, which looks the other way
    for outward in np.moveaxis(normals[near], 1, 0):
        hits = caster.first_hits(points + _REACH_MM * outward, -outward)
        along = hits.distance_mm - _REACH_MM
        is_better = (hits.distance_mm < 2 * _REACH_MM) & (np.abs(along) <= best)
        result = np.where(is_better, along, result)
        best = np.where(is_better, np.abs(along), best)
    return result


def _samples(solids: Sequence[SolidPart]) -> tuple[FloatArray, FloatArray]:
    """Random points on all surfaces, and their normals, both of shape (S, 3)."""
    rng = np.random.default_rng(0)
    corners = np.concatenate([solid.vertices[solid.faces] for solid in solids])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    corners, normals, doubled = (array[doubled > 1e-9] for array in (corners, normals, doubled))
    normals /= doubled[:, None]
    count = int(0.5 * doubled.sum() * _SAMPLES_PER_MM2)
    face = rng.choice(len(corners), size=count, p=doubled / doubled.sum())
    u, v = rng.random((2, count, 1))
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    a, b, c = np.moveaxis(corners[face], 1, 0)
    return a + u * (b - a) + v * (c - a), normals[face]
