"""The rigid motion that maps paired points best."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, as_points
from boltpose.errors import DegenerateGeometryError, ShapeError


def fit_rigid(source_points: npt.ArrayLike, target_points: npt.ArrayLike) -> FloatArray:
    """Fit the rotation and translation of paired points in the least-squares sense.

    A mirror image is never returned, even where it would fit better.

    Args:
        source_points: Shape (N, 3), N >= 3, mm.
        target_points: Shape (N, 3), mm; row i is the partner of source row i.

    Returns:
        `target_from_source`, shape (4, 4).

    Raises:
        ShapeError: The shapes differ or are not (N >= 3, 3), or a value is not finite.
        DegenerateGeometryError: The points lie on one line, so the turn about it is free.

    Source:
        Umeyama, IEEE TPAMI 13(4), 1991, pp. 376-380, with the scale fixed to 1.
    """
    source = as_points(source_points, "source_points", at_least=3)
    target = as_points(target_points, "target_points", at_least=3)
    if source.shape != target.shape:
        raise ShapeError(f"pairs must match: source {source.shape}, target {target.shape}")
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    left, singular, right = np.linalg.svd((target - target_mean).T @ (source - source_mean))
    if singular[1] <= 1e-9 * singular[0]:
        raise DegenerateGeometryError(f"{len(source)} pairs lie on one line: rotation undetermined")
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    matrix = np.eye(4)
    matrix[:3, :3] = (left * sign) @ right
    matrix[:3, 3] = target_mean - matrix[:3, :3] @ source_mean
    return matrix
