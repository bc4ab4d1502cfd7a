"""Layers on rows: the last axis holds the channels, which is the faster order on CPUs."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from boltpose.networks.batch_norm import SharedBatchNorm1d
from boltpose.networks.neighbours import gather


class NormRelu(nn.Module):
    """Batch normalisation and (leaky) ReLU of channels, statistics over all other axes."""

    def __init__(self, channels: int, slope: float = 0.0) -> None:
        super().__init__()
        self.norm = SharedBatchNorm1d(channels)
        self.slope = slope

    def forward(self, values: Tensor) -> Tensor:
        """Shape (..., C) to the same."""
        normal: Tensor = self.norm(values.flatten(0, -2)).reshape(values.shape)
        return functional.leaky_relu(normal, self.slope) if self.slope else torch.relu(normal)


class LinearNormRelu(nn.Module):
    """Linear layer, batch normalisation, (leaky) ReLU."""

    def __init__(self, inputs: int, outputs: int, slope: float = 0.0) -> None:
        super().__init__()
        self.linear = nn.Linear(inputs, outputs, bias=False)
        self.act = NormRelu(outputs, slope)

    def forward(self, values: Tensor) -> Tensor:
        """Shape (..., inputs) to (..., outputs)."""
        result: Tensor = self.act(self.linear(values))
        return result


class PointsAndCloudLinear(nn.Module):
    """Linear layer on every point's features joined with those of its whole cloud.

    The part of the cloud is multiplied once per cloud instead of once per point; the numbers are
    those of the linear layer on the joined features, up to rounding.
    """

    def __init__(self, point_inputs: int, cloud_inputs: int, outputs: int) -> None:
        super().__init__()
        self.point_inputs = point_inputs
        self.linear = nn.Linear(point_inputs + cloud_inputs, outputs, bias=False)

    def forward(self, points: Tensor, cloud: Tensor) -> Tensor:
        """Shapes (B, N, point_inputs) and (B, cloud_inputs) to (B, N, outputs)."""
        of_points = functional.linear(points, self.linear.weight[:, : self.point_inputs])
        of_cloud = functional.linear(cloud, self.linear.weight[:, self.point_inputs :])
        return of_points + of_cloud[:, None]


class EdgeLinear(nn.Module):
    """Linear layer on pairs (F(q) - F(p), F(p)) of a point p and its neighbours q.

    It is applied before the gathering: W (F(q) - F(p)) + V F(p) = W F(q) + (V - W) F(p) needs
    products per point instead of per pair; the numbers are the same up to rounding.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.inputs = inputs
        self.linear = nn.Linear(2 * inputs, outputs, bias=False)

    def forward(self, features: Tensor, index: Tensor) -> Tensor:
        """Shape (B, N, inputs) and neighbours (B, N, K) to (B, N, K, outputs)."""
        of_difference = self.linear.weight[:, : self.inputs]
        of_point = self.linear.weight[:, self.inputs :]
        near = functional.linear(features, of_difference)
        own = functional.linear(features, of_point - of_difference)
        return gather(near, index) + own[:, :, None]
