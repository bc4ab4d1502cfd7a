"""What every network must do, and its size against the published one."""

from __future__ import annotations

from itertools import pairwise

import pytest
import torch
from torch import nn

from boltpose.errors import ConfigError
from boltpose.networks.backbones import BACKBONES, build_backbone
from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.segmentation_network import SegmentationNetwork

CLASSES = 6
every_backbone = pytest.mark.parametrize("name", BACKBONES)


def _ready(name: str, inputs: int = 3) -> SegmentationNetwork:
    """In evaluation mode, normalised as after training, so that scores differ between points."""
    network = build_backbone(name, inputs=inputs, classes=CLASSES)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            module.momentum = None  # keeps the average of all batches, here of one
    with torch.no_grad():
        network(torch.randn(4, 100, inputs))
    return network.eval()


@every_backbone
@pytest.mark.parametrize(("points", "inputs"), [(1, 3), (17, 6), (600, 20)])
def test_any_number_of_points_gets_scores(name: str, points: int, inputs: int) -> None:
    network = _ready(name, inputs)
    with torch.inference_mode():
        scores = network(torch.randn(2, points, inputs))
    assert scores.shape == (2, points, CLASSES)
    assert scores.isfinite().all()


@every_backbone
def test_permuted_points_get_permuted_scores(name: str) -> None:
    network = _ready(name, inputs=6).double()
    inputs = torch.randn(1, 150, 6, dtype=torch.float64)
    # PointNet++ samples from the first point on: that one stays
    order = torch.cat([torch.zeros(1, dtype=torch.int64), 1 + torch.randperm(149)])
    with torch.inference_mode():
        scores = network(inputs)
        torch.testing.assert_close(network(inputs[:, order]), scores[:, order], atol=1e-4, rtol=0)
    assert scores.std(dim=1).min() > 0.1  # points do differ


@every_backbone
def test_clouds_of_a_batch_do_not_see_each_other(name: str) -> None:
    network = _ready(name)
    inputs = torch.randn(3, 130, 3)
    with torch.inference_mode():
        together = network(inputs)
        alone = torch.cat([network(cloud[None]) for cloud in inputs])
    torch.testing.assert_close(together, alone, atol=1e-5, rtol=1e-5)


@every_backbone
def test_the_same_input_gives_the_same_bits(name: str) -> None:
    network = _ready(name)
    inputs = torch.randn(2, 100, 3)
    with torch.inference_mode():
        assert torch.equal(network(inputs), network(inputs))


@every_backbone
@pytest.mark.parametrize("half", [False, True])
def test_every_parameter_learns(name: str, half: bool) -> None:
    network = build_backbone(name, inputs=6, classes=CLASSES)
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=half):
        scores = network(torch.randn(2, 150, 6)).float()
    loss = nn.functional.cross_entropy(scores.flatten(0, 1), torch.arange(300) % CLASSES)
    loss.backward()
    for parameter_name, parameter in network.named_parameters():
        gradient = parameter.grad
        assert gradient is not None, parameter_name
        assert gradient.isfinite().all(), parameter_name
        # a transform network starts with zero weights, nothing flows behind them yet
        if "transform" not in parameter_name or "matrix" in parameter_name:
            assert gradient.abs().max() > 0, parameter_name


@every_backbone
def test_standardisation_is_stored_with_the_weights(name: str) -> None:
    network, other = _ready(name, 5), _ready(name, 5)
    network.set_standardisation(torch.randn(5), torch.rand(5) + 0.5)
    other.load_state_dict(network.state_dict())
    inputs = torch.randn(2, 50, 5)
    with torch.inference_mode():
        assert torch.equal(other(inputs), network(inputs))
    assert torch.equal(other.scale, network.scale)


@every_backbone
def test_moving_and_scaling_a_cloud_with_its_standardisation_changes_nothing(name: str) -> None:
    network = _ready(name, 4)
    inputs = torch.randn(2, 80, 4)
    with torch.inference_mode():
        wanted = network(inputs)
        # the same for all coordinates: neighbourhoods stay
        mean, scale = torch.tensor([2.0, -1.0, 0.5, 9.0]), torch.tensor([3.0, 3.0, 3.0, 7.0])
        network.set_standardisation(mean, scale)
        torch.testing.assert_close(network(inputs * scale + mean), wanted, atol=1e-4, rtol=1e-4)


def _chain(*sizes: int) -> int:
    """Parameters of linear layers without bias and their normalisations."""
    return sum(a * b + 2 * b for a, b in pairwise(sizes))


def _transform(inputs: int, size: int) -> int:
    return _chain(inputs, 64, 128, 1024, 512, 256) + 256 * size**2 + size**2


ATTENTION = 4 * (128 * 32 + 128 * 128 + 128 + _chain(128, 128))
PCT_HEAD = _chain(512, 1024) + _chain(3 * 1024, 512, 256) + 256 * CLASSES + CLASSES
PUBLISHED = {
    "pointnet": _transform(3, 3)
    + _chain(3, 64, 64)
    + _transform(64, 64)
    + _chain(64, 64, 128, 1024)
    + _chain(64 + 1024, 512, 256, 128)
    + 128 * CLASSES
    + CLASSES,
    "pointnet2": _chain(3, 64, 64, 128)
    + _chain(3 + 128, 128, 128, 256)
    + _chain(3 + 256, 256, 512, 1024)
    + _chain(1024 + 256, 256, 256)
    + _chain(256 + 128, 256, 128)
    + _chain(128 + 3, 128, 128, 128)
    + _chain(128, 128)
    + 128 * CLASSES
    + CLASSES,
    "dgcnn": _chain(2 * 3, 64, 64)
    + _chain(2 * 64, 64, 64)
    + _chain(2 * 64, 64)
    + _chain(3 * 64, 1024)
    + _chain(3 * 64 + 1024, 512, 256)
    + 256 * CLASSES,
    "pct": _chain(3, 64, 64)
    + _chain(2 * 64, 128, 128)
    + _chain(2 * 128, 128, 128)
    + ATTENTION
    + PCT_HEAD,
}
"""Layer by layer from the papers and their code, without biases that a normalisation cancels."""


@pytest.mark.parametrize(
    ("name", "millions"), [("pointnet", 3.53), ("pointnet2", 1.40), ("dgcnn", 0.98), ("pct", 2.47)]
)
def test_sizes_are_the_published_ones(name: str, millions: float) -> None:
    network = build_backbone(name, inputs=3, classes=CLASSES)
    count = sum(parameter.numel() for parameter in network.parameters())
    assert count == PUBLISHED[name]
    assert count / 1e6 == pytest.approx(millions, abs=0.005)


def test_point_wise_pct_is_the_published_segmentation_code() -> None:
    network = Pct(PctConfig(inputs=3, classes=CLASSES, neighbours=0))
    count = sum(parameter.numel() for parameter in network.parameters())
    assert count == _chain(3, 128, 128) + ATTENTION + PCT_HEAD


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"'unet'.*pointnet, pointnet2, dgcnn, pct, pct-small"):
        build_backbone("unet", inputs=3, classes=2)
