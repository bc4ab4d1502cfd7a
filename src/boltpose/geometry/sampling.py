"""Thin point clouds without randomness."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, IntArray, as_points


def voxel_groups(points: npt.ArrayLike, voxel_mm: float) -> IntArray:
    """Number the occupied voxels and tell each point's.

    Args:
        points: Shape (N, 3), mm, any frame.
        voxel_mm: Edge length of the voxels; the grid starts at the smallest coordinates.

    Returns:
        Shape (N,), int64, 0 to the number of occupied voxels - 1, in lexicographic voxel order.

    Raises:
        ShapeError: `points` is not (N, 3) and finite.
        ValueError: `voxel_mm` is not positive or so small that voxel numbers overflow.
    """
    cloud = as_points(points, "points")
    if not voxel_mm > 0:
        raise ValueError(f"voxel_mm must be > 0, got {voxel_mm}")
    cells = np.floor((cloud - cloud.min(axis=0)) / voxel_mm).astype(np.int64)
    spans = [int(span) for span in cells.max(axis=0) + 1]
    if spans[0] * spans[1] * spans[2] > 2**62:
        raise ValueError(f"voxel_mm {voxel_mm} is too small for a cloud of this extent")
    keys = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    if spans[0] * spans[1] * spans[2] <= 8 * len(cloud) + 2**20:
        # a table of all voxels numbers them without sorting, several times faster
        occupied = np.zeros(spans[0] * spans[1] * spans[2], dtype=np.bool_)
        occupied[keys] = True
        return (np.cumsum(occupied, dtype=np.int64) - 1)[keys]
    _, group = np.unique(keys, return_inverse=True)
    return group.reshape(-1).astype(np.int64, copy=False)


def group_means(values: npt.ArrayLike, group: IntArray) -> FloatArray:
    """Average rows of `values`, shape (N, C), per group; returns (G, C)."""
    rows = np.asarray(values, dtype=np.float64)
    count = np.bincount(group)
    sums = [np.bincount(group, weights=column, minlength=len(count)) for column in rows.T]
    return np.stack(sums, axis=1) / count[:, None]


def voxel_downsample(points: npt.ArrayLike, voxel_mm: float) -> FloatArray:
    """Replace the points of each voxel by their mean; shape (G, 3), mm, in voxel order."""
    cloud = as_points(points, "points")
    return group_means(cloud, voxel_groups(cloud, voxel_mm))


def voxel_representatives(points: npt.ArrayLike, voxel_mm: float) -> IntArray:
    """Index, per voxel, of the point nearest to the mean of its points; shape (G,), in voxel order.

    Unlike the mean, a representative lies on the measured surface and keeps its label.
    """
    cloud = as_points(points, "points")
    group = voxel_groups(cloud, voxel_mm)
    distance = np.linalg.norm(cloud - group_means(cloud, group)[group], axis=1)
    order = np.lexsort((distance, group))
    first = np.r_[True, np.diff(group[order]) > 0]
    return order[first].astype(np.int64, copy=False)
