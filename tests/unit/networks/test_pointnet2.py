from __future__ import annotations

import pytest
import torch

from boltpose.networks.neighbours import ball_neighbours, farthest_point_sample, gather
from boltpose.networks.pointnet2 import PointNet2, PointNet2Config, SetAbstraction, to_unit_sphere


def _network(inputs: int = 3) -> PointNet2:
    return PointNet2(PointNet2Config(inputs=inputs, classes=4)).eval()


@pytest.mark.parametrize("points", [30, 700])
def test_given_centres_are_those_it_would_find(points: int) -> None:
    network = _network()
    inputs = torch.randn(2, points, 3)
    centres_1 = farthest_point_sample(inputs, 512)
    centres_2 = farthest_point_sample(gather(inputs, centres_1), 128)
    with torch.inference_mode():
        assert torch.equal(network(inputs, centres_1, centres_2), network(inputs))


def test_other_centres_are_used() -> None:
    network = _network()
    inputs = torch.randn(1, 700, 3)
    with torch.inference_mode():
        centres = torch.arange(512)[None]
        assert not torch.allclose(network(inputs, centres), network(inputs))


def test_size_and_place_of_a_cloud_do_not_matter() -> None:
    network = _network()
    inputs = torch.randn(2, 200, 3)
    with torch.inference_mode():
        torch.testing.assert_close(network(40 * inputs - 9), network(inputs), atol=1e-4, rtol=1e-4)


def test_unit_sphere() -> None:
    scaled = to_unit_sphere(5 * torch.randn(3, 90, 3) + 2)
    torch.testing.assert_close(scaled.mean(dim=1), torch.zeros(3, 3), atol=1e-6, rtol=0)
    torch.testing.assert_close(scaled.norm(dim=2).amax(dim=1), torch.ones(3))
    assert to_unit_sphere(torch.ones(1, 4, 3)).isfinite().all()


def test_linear_before_gathering_is_linear_on_the_members() -> None:
    layer = SetAbstraction(5, (8, 9)).double()
    xyz = torch.randn(2, 50, 3, dtype=torch.float64)
    features = torch.randn(2, 50, 5, dtype=torch.float64, requires_grad=True)
    centres = xyz[:, ::4]
    index = ball_neighbours(centres, xyz, 1.0, 6)

    offsets = gather(xyz, index) - centres[:, :, None]
    members = layer.linear(torch.cat([offsets, gather(features, index)], dim=3))
    wanted = layer.more(layer.act(members)).amax(dim=2)
    got = layer(centres, xyz, features, index)

    torch.testing.assert_close(got, wanted, atol=1e-10, rtol=1e-10)
    leaves = [features, layer.linear.weight]
    for one, other in zip(
        torch.autograd.grad(got.sin().sum(), leaves),
        torch.autograd.grad(wanted.sin().sum(), leaves),
        strict=True,
    ):
        torch.testing.assert_close(one, other, atol=1e-9, rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("inputs", 2),
        ("radii", (0.0, 0.4)),
        ("centres", (100, 200)),
        ("down_1", ()),
        ("dropout", 1.0),
    ],
)
def test_settings_are_checked(name: str, value: object) -> None:
    settings = {"inputs": 3, "classes": 2, name: value}
    with pytest.raises(ValueError, match=name):
        PointNet2Config(**settings)  # pyright: ignore[reportArgumentType]
