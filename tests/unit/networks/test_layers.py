from __future__ import annotations

import torch
from torch import Tensor

from boltpose.networks.layers import EdgeLinear, NormRelu, PointsAndCloudLinear
from boltpose.networks.neighbours import gather, nearest_neighbours


def _compare(got: Tensor, wanted: Tensor, leaves: list[Tensor]) -> None:
    torch.testing.assert_close(got, wanted, atol=1e-12, rtol=1e-12)
    got_gradients = torch.autograd.grad(got.sin().sum(), leaves)
    wanted_gradients = torch.autograd.grad(wanted.sin().sum(), leaves)
    for one, other in zip(got_gradients, wanted_gradients, strict=True):
        torch.testing.assert_close(one, other, atol=1e-11, rtol=1e-11)


def test_linear_before_gathering_is_linear_on_the_pairs() -> None:
    layer = EdgeLinear(7, 9).double()
    features = torch.randn(2, 40, 7, dtype=torch.float64, requires_grad=True)
    index = nearest_neighbours(features[:, :, :3], features[:, :, :3], 6)

    neighbours = gather(features, index)
    own = features[:, :, None].expand_as(neighbours)
    wanted = layer.linear(torch.cat([neighbours - own, own], dim=3))

    _compare(layer(features, index), wanted, [features, layer.linear.weight])


def test_cloud_features_multiplied_once_are_those_of_every_point() -> None:
    layer = PointsAndCloudLinear(5, 8, 6).double()
    points = torch.randn(2, 30, 5, dtype=torch.float64, requires_grad=True)
    cloud = torch.randn(2, 8, dtype=torch.float64, requires_grad=True)

    joined = torch.cat([points, cloud[:, None].expand(-1, 30, -1)], dim=2)
    wanted = layer.linear(joined)

    _compare(layer(points, cloud), wanted, [points, cloud, layer.linear.weight])


def test_normalisation_is_per_channel_over_everything_else() -> None:
    layer = NormRelu(4, slope=0.2)
    values = torch.randn(3, 5, 6, 4) * torch.tensor([1.0, 10.0, 0.1, 5.0]) + 7
    flat = layer(values).reshape(-1, 4)
    normal = torch.where(flat < 0, flat / 0.2, flat)
    torch.testing.assert_close(normal.mean(dim=0), torch.zeros(4), atol=1e-4, rtol=0)
    torch.testing.assert_close(normal.var(dim=0, correction=0), torch.ones(4), atol=2e-3, rtol=0)
