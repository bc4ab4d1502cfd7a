"""Neighbours of points in batches of clouds: search, sampling, gathering, interpolation.

All but `farthest_point_sample` export to ONNX with any batch and number of points.
"""

from __future__ import annotations

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
        Shape (B, M, N), float32 even under autocast.
    """
    with torch.autocast(queries.device.type, enabled=False):
        centre = points.float().mean(dim=1, keepdim=True)
        left, right = queries.float() - centre, points.float() - centre
        products = left @ right.transpose(1, 2)
        squares = right.square().sum(dim=2)[:, None, :]
        return torch.clamp(left.square().sum(dim=2, keepdim=True) - 2 * products + squares, min=0)


def nearest_neighbours(queries: Tensor, points: Tensor, count: int) -> Tensor:
    """Indices of the nearest points of every query, nearest first.

    Args:
        queries: Shape (B, M, C).
        points: Shape (B, N, C).
        count: Neighbours per query; the N nearest where there are fewer points.

    Returns:
        Shape (B, M, min(count, N)), int64. A query that is one of the points finds itself.
    """
    with torch.no_grad():
        distances = square_distances(queries, points)
        return distances.topk(at_most(count, points.shape[1]), dim=2, largest=False).indices


def gather(values: Tensor, index: Tensor) -> Tensor:
    """Rows of each cloud by index: (B, N, C) and (B, M) or (B, M, K) to (B, M, [K,] C)."""
    batch, channels = values.shape[0], values.shape[2]
    flat = index.reshape(batch, -1, 1).expand(-1, -1, channels)
    return torch.gather(values, 1, flat).reshape(*index.shape, channels)


def at_most(count: int, available: int) -> int:
    """The smaller one, also while exporting, where `available` is symbolic."""
    return min(count, available)
