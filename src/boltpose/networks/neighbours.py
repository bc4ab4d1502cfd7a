"""Neighbours of points in batches of clouds: search, sampling, gathering, interpolation.

All but `farthest_point_sample` export to ONNX with any batch and number of points. Searches
have no gradient and run in float32 also under autocast.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor


def square_distances(queries: Tensor, points: Tensor) -> Tensor:
    """Squared distances by one matrix product; never below zero.

    Both sides are shifted by the mean of the points first: far from the origin the expansion
    a^2 - 2ab + b^2 loses its digits.

    Args:
        queries: Shape (B, M, C).
        points: Shape (B, N, C).

    Returns:
        Shape (B, M, N), float32.
    """
    with torch.autocast(queries.device.type, enabled=False):
        centre = points.float().mean(dim=1, keepdim=True)
        left, right = queries.float() - centre, points.float() - centre
        squares = right.square().sum(dim=2)[:, None, :] + left.square().sum(dim=2)[:, :, None]
        return torch.baddbmm(squares, left, right.transpose(1, 2), alpha=-2).clamp(min=0)


def nearest_neighbours(queries: Tensor, points: Tensor, count: int) -> Tensor:
    """Indices of the nearest points of every query, nearest first.

    Args:
        queries: Shape (B, M, C).
        points: Shape (B, N, C).
        count: Neighbours per query; all points where there are fewer.

    Returns:
        Shape (B, M, min(count, N)), int64. A query that is one of the points finds itself.
    """
    with torch.no_grad():
        return _nearest(queries, points, count)[1]


def ball_neighbours(queries: Tensor, points: Tensor, radius: float, count: int) -> Tensor:
    """Indices of a fixed number of points within a radius.

    Where more than `count` are in the ball, the nearest are taken; where fewer, the nearest
    one fills the rest, so that a maximum over them does not change. A query with none in its
    ball gets its nearest point.

    Args:
        queries: Shape (B, M, 3).
        points: Shape (B, N, 3).
        radius: In the unit of the points.
        count: Neighbours per query; all points where there are fewer.

    Returns:
        Shape (B, M, min(count, N)), int64.

    Source:
        Qi et al., NeurIPS 2017 (PointNet++), section 3.2, where the first of the list are taken
        rather than the nearest: the nearest do not depend on the order of the points.
    """
    with torch.no_grad():
        distances, index = _nearest(queries, points, count)
        return torch.where(distances <= radius**2, index, index[:, :, :1])


def farthest_point_sample(points: Tensor, count: int) -> Tensor:
    """Spread indices: each next point is the farthest from those already chosen.

    Starts at index 0, so that the same cloud gives the same sample. The first m of a sample
    are again the sample of m points. Ties go to the lower index.

    Args:
        points: Shape (B, N, 3).
        count: Points to choose; all where there are fewer.

    Returns:
        Shape (B, min(count, N)), int64.

    Source:
        Qi et al., NeurIPS 2017 (PointNet++), section 3.2.
    """
    with torch.no_grad():
        x, y, z = points.float().unbind(dim=2)
        batch = len(points)
        rows = torch.arange(batch, device=points.device)
        chosen = torch.zeros(
            batch, min(count, points.shape[1]), dtype=torch.int64, device=points.device
        )
        nearest = torch.full_like(x, torch.inf)
        for step in range(1, chosen.shape[1]):
            last = chosen[:, step - 1]
            squares = (x - x[rows, last, None]).square_()
            squares += (y - y[rows, last, None]).square_()
            squares += (z - z[rows, last, None]).square_()
            torch.minimum(nearest, squares, out=nearest)
            chosen[:, step] = nearest.argmax(dim=1)
        return chosen


def gather(values: Tensor, index: Tensor) -> Tensor:
    """Rows of each cloud by index.

    Args:
        values: Shape (B, N, C).
        index: Shape (B, M) or (B, M, K), int64, into axis N.

    Returns:
        Shape (B, M, C) or (B, M, K, C).
    """
    batch, points, channels = values.shape
    first_rows = torch.arange(batch, device=values.device) * points
    flat = index.reshape(batch, -1) + first_rows[:, None]
    # whole rows are copied: much faster than torch.gather with an expanded index
    rows = values.reshape(-1, channels).index_select(0, flat.reshape(-1))
    return rows.reshape(*index.shape, channels)


def interpolate(queries: Tensor, points: Tensor, values: Tensor) -> Tensor:
    """Values at queries: of their three nearest points, weighted by 1 / squared distance.

    Args:
        queries: Shape (B, M, 3).
        points: Shape (B, N, 3).
        values: Shape (B, N, C).

    Returns:
        Shape (B, M, C).

    Source:
        Qi et al., NeurIPS 2017 (PointNet++), equation 2 with k = 3, p = 2.
    """
    with torch.no_grad(), torch.autocast(queries.device.type, enabled=False):
        index = nearest_neighbours(queries, points, 3)
        differences = gather(points.float(), index) - queries.float()[:, :, None]
        weights = 1 / differences.square().sum(dim=3).clamp(min=1e-10)
        weights = weights / weights.sum(dim=2, keepdim=True)
    return (gather(values, index) * weights[:, :, :, None]).sum(dim=2)


def _nearest(queries: Tensor, points: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Squared distances and indices, (B, M, min(count, N)) each, nearest first."""
    distances = square_distances(queries, points)
    # sym_min, not min: while exporting, the number of points is a symbol
    most = cast(int, torch.sym_min(count, points.shape[1]))
    found = distances.topk(most, dim=2, largest=False)
    return found.values, found.indices
