"""Nearest surface point in constant time, from a voxel grid around a fixed cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from boltpose.arrays import FloatArray, IntArray, as_points, freeze
from boltpose.geometry.sampling import group_means, voxel_groups


@dataclass(frozen=True, slots=True, eq=False)
class NearestGrid:
    """For every cell of a box around a cloud, the index of a cloud point near the cell.

    The answer is approximate: the true nearest point can be closer by up to about one cell
    diagonal. Queries outside the box get the answer of the nearest cell of its border.
    """

    origin_mm: FloatArray
    """Shape (3,): lower corner of the box, in the cloud's frame."""
    cell_mm: float
    index: IntArray
    """Shape (X, Y, Z), int64 rows of the cloud."""

    def nearest(self, points: npt.NDArray[np.floating]) -> IntArray:
        """Return, for points of shape (..., 3), mm, the rows of near cloud points, shape (...)."""
        scaled = (points - self.origin_mm.astype(points.dtype)) * points.dtype.type(
            1.0 / self.cell_mm
        )
        upper = np.array(self.index.shape, dtype=points.dtype) - points.dtype.type(0.5)
        cells = np.clip(scaled, points.dtype.type(0), upper, out=scaled).astype(np.int32)
        _, size_y, size_z = self.index.shape
        flat = (cells[..., 0] * size_y + cells[..., 1]) * size_z + cells[..., 2]
        return self.index.reshape(-1).take(flat)


def build_nearest_grid(points: npt.ArrayLike, *, cell_mm: float, margin_mm: float) -> NearestGrid:
    """Fill a box around a cloud with the index of the nearest occupied cell's point.

    Args:
        points: Shape (N, 3), mm.
        cell_mm: Edge length of the cells.
        margin_mm: How far the box reaches beyond the cloud.

    Returns:
        The grid; its indices are rows of `points`.

    Raises:
        ShapeError: `points` is not (N, 3) and finite.
        ValueError: `cell_mm` is not positive.

    Source:
        Euclidean distance transform of Maurer et al., IEEE TPAMI 25(2), 2003, as in SciPy.
    """
    cloud = as_points(points, "points")
    if not cell_mm > 0:
        raise ValueError(f"cell_mm must be > 0, got {cell_mm}")
    origin = cloud.min(axis=0) - margin_mm
    shape = np.ceil((cloud.max(axis=0) + margin_mm - origin) / cell_mm).astype(np.int64) + 1
    cells = np.floor((cloud - origin) / cell_mm).astype(np.int64)
    centres = origin + (cells + 0.5) * cell_mm
    away = np.linalg.norm(cloud - centres, axis=1)
    holder = np.full(tuple(shape), -1, dtype=np.int64)
    # written from the farthest to the nearest: the point closest to the centre stays
    order = np.argsort(-away, kind="stable")
    holder[tuple(cells[order].T)] = order
    nearest_cell = distance_transform_edt(holder < 0, return_distances=False, return_indices=True)
    index = holder[tuple(np.asarray(nearest_cell))]
    return NearestGrid(freeze(origin), cell_mm, freeze(index))


def thin_with_normals(
    points: FloatArray, normals: FloatArray, voxel_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Average points and normals per voxel; returns (G, 3) mm and (G, 3) unit.

    Voxels that hold both sides of a sheet, whose normals cancel, are dropped.
    """
    group = voxel_groups(points, voxel_mm)
    means = group_means(np.hstack([points, normals]), group)
    length = np.linalg.norm(means[:, 3:], axis=1)
    keep = length > 0.5
    return means[keep, :3], means[keep, 3:] / length[keep, None]
