"""What the labels around a point look like: averages of per-point values over neighbourhoods."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import Float32Array, FloatArray, IntArray
from boltpose.geometry.sampling import group_means, voxel_groups

_VOXELS_PER_RADIUS = 2.0
_NEIGHBOURS = 16
"""About 13 voxel means of a plane lie within a radius of two voxels."""
_CHUNK = 4096
_THREADS = 2


@dataclass(frozen=True, slots=True, eq=False)
class _Ring:
    group: IntArray
    index: IntArray
    share: Float32Array


class Neighbourhoods:
    """The neighbourhoods of a cloud's points, found once, averaged over as often as wanted."""

    def __init__(
        self, points: FloatArray, radii_mm: tuple[float, ...], at: IntArray | None = None
    ) -> None:
        """Find the neighbourhoods.

        Args:
            points: Shape (N, 3), mm, any frame.
            radii_mm: One neighbourhood per point and radius.
            at: Indices, shape (M,), of the points whose neighbourhoods are wanted; all by
                default.
        """
        self._size = len(points)
        queries = points if at is None else points[at]
        self._count = len(queries)
        self._rings: list[_Ring] = []
        for radius in radii_mm:
            group = voxel_groups(points, radius / _VOXELS_PER_RADIUS)
            tree = KDTree(group_means(points, group))
            width = min(_NEIGHBOURS, tree.n)
            distance, index = tree.query(queries, k=width, workers=-1)
            scaled = np.reshape(distance, (len(queries), width)) / radius
            weight = np.maximum(1.0 - scaled * scaled, 1e-6)
            share = (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32)
            self._rings.append(_Ring(group, np.reshape(index, share.shape), share))

    def average(self, values: npt.ArrayLike) -> Float32Array:
        """Average values over every neighbourhood.

        Args:
            values: Shape (N, C), one row per point of the cloud.

        Returns:
            Shape (M, C * radii), the columns of the smallest radius first.
        """
        rows = np.asarray(values, dtype=np.float64)
        if len(rows) != self._size:
            raise ValueError(f"values must have {self._size} rows, got {len(rows)}")
        width = rows.shape[1]
        result = np.zeros((self._count, width * len(self._rings)), dtype=np.float32)
        for number, ring in enumerate(self._rings):
            means = group_means(rows, ring.group).astype(np.float32)
            columns = slice(number * width, (number + 1) * width)

            def fill(
                start: int,
                ring: _Ring = ring,
                means: Float32Array = means,
                columns: slice = columns,
            ) -> None:
                part = slice(start, start + _CHUNK)
                near = means[ring.index[part]]
                result[part, columns] = np.matmul(ring.share[part, None], near)[:, 0]

            with ThreadPoolExecutor(_THREADS) as pool:
                list(pool.map(fill, range(0, self._count, _CHUNK)))
        return result
