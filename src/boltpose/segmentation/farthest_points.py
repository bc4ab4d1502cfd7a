"""Centres that PointNet++ groups points around, chosen outside its ONNX file: it has no loops."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import Float32Array, IntArray


def farthest_points(places: Float32Array, count: int) -> IntArray:
    """Choose points one after the other, each the farthest from all chosen before.

    The same arithmetic as `boltpose.networks.neighbours.farthest_point_sample`, so the same
    choice: float32, the squares of x, y and z added in this order, the first of equally far
    points, point 0 to begin with.

    Args:
        places: Shape (B, N, 3), float32.
        count: Centres per cloud; all points where there are fewer.

    Returns:
        Shape (B, min(count, N)), int64, indices into the points.
    """
    clouds = np.arange(len(places))
    x, y, z = (np.ascontiguousarray(places[:, :, axis]) for axis in range(3))
    nearest = np.full(x.shape, np.inf, dtype=np.float32)
    chosen = np.zeros((len(places), min(count, places.shape[1])), dtype=np.int64)
    last = np.zeros(len(places), dtype=np.int64)
    for turn in range(chosen.shape[1]):
        chosen[:, turn] = last
        from_x = x - x[clouds, last, None]
        from_y = y - y[clouds, last, None]
        from_z = z - z[clouds, last, None]
        squared = from_x * from_x + from_y * from_y + from_z * from_z
        np.minimum(nearest, squared, out=nearest)
        last = nearest.argmax(axis=1)
    return chosen


def nested_centres(places: Float32Array, counts: tuple[int, ...]) -> tuple[IntArray, ...]:
    """Choose centres among the points, then among those centres, and so on.

    Args:
        places: Shape (B, N, 3), float32.
        counts: Centres of every level, falling.

    Returns:
        One array per level, int64: shape (B, min(count, N)), indices into the level before it,
        the points for the first. From the second level on these are the first ones: what was
        farthest from all chosen before is so among the chosen too.
    """
    first = farthest_points(places, counts[0])
    levels = [first]
    for count in counts[1:]:
        most = min(count, levels[-1].shape[1])
        levels.append(np.tile(np.arange(most, dtype=np.int64), (len(places), 1)))
    return tuple(levels)
