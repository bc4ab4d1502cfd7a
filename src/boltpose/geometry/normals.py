"""Surface normals of point clouds and which way they point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, IntArray, as_points

_CHUNK = 65536


def smallest_eigenvectors(covariances: FloatArray) -> FloatArray:
    """Unit eigenvectors, (N, 3), of the smallest eigenvalues of matrices, shape (N, 3, 3)."""
    return np.linalg.eigh(covariances)[1][:, :, 0]


def estimate_normals(
    points: npt.ArrayLike, neighbours: int = 20, *, at: IntArray | None = None
) -> FloatArray:
    """Fit a plane to each point's nearest neighbours and return its normal, sign arbitrary.

    Args:
        points: Shape (N, 3), N >= 3, mm, any frame.
        neighbours: How many nearest points, itself included, make the plane.
        at: Indices, shape (M,), where normals are wanted; all by default.

    Returns:
        Shape (N or M, 3), unit vectors.

    Raises:
        ShapeError: `points` is not (N >= 3, 3) and finite.

    Source:
        Hoppe et al., SIGGRAPH 1992, section 3.1 (tangent planes only).
    """
    cloud = as_points(points, "points", at_least=3)
    tree = KDTree(cloud)
    queries = cloud if at is None else cloud[at]
    count = min(neighbours, len(cloud))
    normals = np.zeros((len(queries), 3))
    for start in range(0, len(queries), _CHUNK):
        part = slice(start, start + _CHUNK)
        _, index = tree.query(queries[part], k=count, workers=-1)
        local = cloud[index] - queries[part][:, None]
        local = local - local.mean(axis=1, keepdims=True)
        normals[part] = smallest_eigenvectors(np.einsum("nki,nkj->nij", local, local))
    return normals


def orient_towards(points: FloatArray, normals: FloatArray, viewpoint: npt.ArrayLike) -> FloatArray:
    """Flip normals to face a viewpoint, shape (3,): a camera saw every point of its view."""
    facing = np.einsum("ni,ni->n", normals, np.asarray(viewpoint, dtype=np.float64) - points)
    return np.where(facing[:, None] < 0, -normals, normals)


def fibonacci_directions(count: int) -> FloatArray:
    """Spread `count` unit vectors evenly over the sphere; shape (count, 3)."""
    index = np.arange(count) + 0.5
    z = 1 - 2 * index / count
    angle = np.pi * (1 + 5**0.5) * index
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


def orient_outward(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    *,
    directions: int = 42,
    cell_mm: float = 2.0,
    depth_mm: float = 2.5,
) -> FloatArray:
    """Flip the normals of a complete scan so that they point out of the material.

    From every direction an orthographic depth buffer tells which points are in front; a visible
    point votes for the sign that faces the viewer. Points no direction sees take the sign of
    their nearest decided neighbours.

    Args:
        points: Shape (N, 3), mm, a complete scan.
        normals: Shape (N, 3), unit, any sign.
        directions: Viewing directions, evenly spread.
        cell_mm: Cell of the depth buffer; must exceed the point spacing, or gaps let the far
            side shine through.
        depth_mm: Points this far behind the front still count as visible.

    Returns:
        Shape (N, 3), unit vectors.

    Source:
        Katz et al., SIGGRAPH 2007, state the visibility idea; the depth buffer is ours.
    """
    cloud = as_points(points, "points")
    signed = np.array(normals, dtype=np.float64)
    votes = np.zeros(len(cloud))
    for direction in fibonacci_directions(directions):
        helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
        right = np.cross(direction, helper)
        right /= np.linalg.norm(right)
        up = np.cross(direction, right)
        # direction points from the cloud to the viewer: the largest height is in front
        height = cloud @ direction
        u = np.floor((cloud @ right) / cell_mm).astype(np.int64)
        v = np.floor((cloud @ up) / cell_mm).astype(np.int64)
        u -= u.min() - 1
        v -= v.min() - 1
        front = np.full((int(u.max()) + 2, int(v.max()) + 2), -np.inf)
        np.maximum.at(front, (u, v), height)
        facing = signed @ direction
        votes += np.where(height > front[u, v] - depth_mm, facing * np.abs(facing), 0.0)
    decided = np.abs(votes) > 1e-3
    if decided.any() and not decided.all():
        _, nearest = KDTree(cloud[decided]).query(cloud[~decided], k=min(5, int(decided.sum())))
        index = np.asarray(nearest, dtype=np.int64).reshape(int((~decided).sum()), -1)
        partners = (signed * np.sign(votes)[:, None])[decided][index]
        votes[~decided] = np.einsum("ni,nki->n", signed[~decided], partners)
    return np.where(votes[:, None] < 0, -signed, signed)
