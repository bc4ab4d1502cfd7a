"""Bodies swept along a curve: cables, braids, bars."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, IntArray, as_points
from boltpose.errors import DegenerateGeometryError
from boltpose.factory.solids import Manifold, Mesh64


def sweep(
    outline_mm: npt.ArrayLike,
    curve_mm: npt.ArrayLike,
    *,
    first_up: npt.ArrayLike,
    scale: npt.ArrayLike = 1.0,
) -> Manifold:
    """Sweep a convex outline along a curve, without twist.

    Args:
        outline_mm: Shape (K, 2), counter-clockwise, in the plane across the curve.
        curve_mm: Shape (N, 3), N >= 2.
        first_up: Shape (3,), where the outline's second axis points at the start.
        scale: Size of the outline at each point of the curve, one number or shape (N,).

    Raises:
        DegenerateGeometryError: The curve stands still, or `first_up` runs along it.

    Source:
        Frames by double reflection: Wang et al., ACM Trans. Graphics 27(1), 2008.
    """
    outline = np.asarray(outline_mm, dtype=np.float64)
    curve = as_points(curve_mm, "curve_mm", at_least=2)
    tangents = np.gradient(curve, axis=0)
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    if lengths.min() < 1e-9:
        raise DegenerateGeometryError("the curve of a sweep stands still")
    tangents = tangents / lengths
    ups = _frames(curve, tangents, np.asarray(first_up, dtype=np.float64))
    sides = np.cross(ups, tangents)
    sizes = np.broadcast_to(np.asarray(scale, dtype=np.float64), (len(curve),))
    rings = curve[:, None] + sizes[:, None, None] * (
        outline[None, :, :1] * sides[:, None] + outline[None, :, 1:] * ups[:, None]
    )
    vertices = np.concatenate([rings.reshape(-1, 3), curve[:1], curve[-1:]])
    mesh = Mesh64(
        vert_properties=vertices, tri_verts=_faces(len(curve), len(outline)).astype(np.uint64)
    )
    return Manifold(mesh)


def _frames(curve: FloatArray, tangents: FloatArray, first_up: FloatArray) -> FloatArray:
    up = first_up - (first_up @ tangents[0]) * tangents[0]
    if np.linalg.norm(up) < 1e-6:
        raise DegenerateGeometryError("first_up of a sweep runs along its curve")
    ups = [up / np.linalg.norm(up)]
    for index in range(len(curve) - 1):
        chord = curve[index + 1] - curve[index]
        share = 2 / (chord @ chord)
        reflected = ups[-1] - share * (chord @ ups[-1]) * chord
        tangent = tangents[index] - share * (chord @ tangents[index]) * chord
        second = tangents[index + 1] - tangent
        if second @ second > 1e-18:
            reflected = reflected - 2 / (second @ second) * (second @ reflected) * second
        ups.append(reflected / np.linalg.norm(reflected))
    return np.array(ups)


def _faces(rings: int, corners: int) -> IntArray:
    """Triangles of the mantle and of both ends, seen counter-clockwise from outside."""
    ring = np.repeat(np.arange(rings - 1), corners) * corners
    here = np.tile(np.arange(corners), rings - 1)
    after = (here + 1) % corners
    a, b = ring + here, ring + after
    c, d = a + corners, b + corners
    start, end = rings * corners, rings * corners + 1
    k = np.arange(corners)
    last = (rings - 1) * corners
    faces = [
        np.stack([a, b, d], 1),
        np.stack([a, d, c], 1),
        np.stack([np.full(corners, start), (k + 1) % corners, k], 1),
        np.stack([np.full(corners, end), last + k, last + (k + 1) % corners], 1),
    ]
    return np.concatenate(faces)
