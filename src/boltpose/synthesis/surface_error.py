"""How far points are off the solids they were measured on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray
from boltpose.factory.model import SolidPart

_SAMPLES_PER_MM2 = 1.5
_NEIGHBOURS = 8


def signed_errors_mm(points: FloatArray, solids: Sequence[SolidPart]) -> FloatArray:
    """Distances from the surface, outside positive.

    To the triangles of the nearest few samples of the surface: exact where the nearest triangle
    is among them, which small ones beside a long edge may miss.

    Args:
        points: Shape (N, 3), mm, frame of the solids.
        solids: What was measured.

    Returns:
        Shape (N,), mm.
    """
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
    samples = a + u * (b - a) + v * (c - a)
    _, near = KDTree(samples).query(points, k=_NEIGHBOURS)
    offsets, distances = _to_triangles(points, corners[face[near]])
    nearest = distances.argmin(axis=1)[:, None]
    distance = np.take_along_axis(distances, nearest, axis=1)[:, 0]
    side = np.einsum("nki,nki->nk", offsets, normals[face[near]])
    return np.where(np.take_along_axis(side, nearest, axis=1)[:, 0] < 0, -distance, distance)


def _to_triangles(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """From the closest spot of triangles, shape (N, K, 3, 3), to points, shape (N, 3).

    Returns:
        Offsets, shape (N, K, 3), and their lengths, shape (N, K).
    """
    a, b, c = (corners[:, :, row] for row in range(3))
    here = points[:, None]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    best = _dot(here - a, normal)[..., None] * normal
    is_inside = np.ones(best.shape[:2], dtype=np.bool_)
    rim = np.full_like(best, np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        is_inside &= _dot(np.cross(edge, here - start), normal) >= 0
        share = np.clip(_dot(here - start, edge) / np.maximum(_dot(edge, edge), 1e-18), 0, 1)
        offset = here - start - share[..., None] * edge
        is_nearer = np.linalg.norm(offset, axis=-1) < np.linalg.norm(rim, axis=-1)
        rim = np.where(is_nearer[..., None], offset, rim)
    offsets = np.where(is_inside[..., None], best, rim)
    return offsets, np.linalg.norm(offsets, axis=-1)


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    """Along the last axis."""
    return np.sum(first * second, axis=-1)
