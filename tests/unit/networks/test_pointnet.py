from __future__ import annotations

import copy

import pytest
import torch

from boltpose.networks.pointnet import PointNet, PointNetConfig


def _small() -> PointNet:
    return PointNet(
        PointNetConfig(
            inputs=4,
            classes=3,
            local=8,
            hidden=16,
            embedding=32,
            head=(16, 8),
            transform_head=(8, 8),
        )
    )


def test_transforms_start_as_the_identity() -> None:
    network = _small().eval()
    with torch.inference_mode():
        for transform, size, inputs in (
            (network.input_transform, 3, torch.randn(2, 20, 3)),
            (network.feature_transform, 8, torch.randn(2, 20, 8)),
        ):
            torch.testing.assert_close(transform(inputs), torch.eye(size).expand(2, -1, -1))


def test_the_penalty_is_the_distance_of_the_feature_transform_from_a_turn() -> None:
    network = _small()
    network(torch.randn(2, 20, 4))
    assert network.penalty() == 0  # the identity is a turn

    with torch.no_grad():
        network.feature_transform.matrix.bias.mul_(2)
    network(torch.randn(2, 20, 4))
    # |I - 4 I|^2 = 9 per channel
    torch.testing.assert_close(network.penalty(), torch.tensor(0.001 * 9 * 8))


def test_the_penalty_teaches_the_transform() -> None:
    network = _small()
    with torch.no_grad():
        network.feature_transform.matrix.bias.add_(0.1)
    network(torch.randn(2, 20, 4))
    network.penalty().backward()
    gradient = network.feature_transform.matrix.weight.grad
    assert gradient is not None
    assert gradient.abs().max() > 0


def test_the_penalty_is_handed_over_once_and_only_in_training() -> None:
    network = _small()
    assert network.penalty() == 0
    with torch.no_grad():
        network.feature_transform.matrix.bias.mul_(2)
    network(torch.randn(2, 20, 4))
    assert network.penalty() > 0
    assert network.penalty() == 0
    copy.deepcopy(network)  # refused where a graph is kept
    network.eval()
    network(torch.randn(2, 20, 4))
    assert network.penalty() == 0


@pytest.mark.parametrize(
    ("name", "value"), [("inputs", 2), ("classes", 0), ("head", ()), ("penalty_weight", -1.0)]
)
def test_settings_are_checked(name: str, value: object) -> None:
    settings = {"inputs": 3, "classes": 2, name: value}
    with pytest.raises(ValueError, match=name):
        PointNetConfig(**settings)  # pyright: ignore[reportArgumentType]
