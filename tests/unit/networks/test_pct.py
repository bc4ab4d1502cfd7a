from __future__ import annotations

import pytest
import torch

from boltpose.networks.pct import (
    OffsetAttention,
    Pct,
    PctConfig,
    offset_attention,
    textbook_offset_attention,
)


@pytest.fixture(autouse=True)
def _seeded() -> None:
    torch.manual_seed(0)


def _small(inputs: int = 7) -> Pct:
    return Pct(PctConfig.small(inputs, 3, channels=16, layers=2, embedding=32))


@pytest.mark.parametrize("sharpness", [0.3, 3.0])
def test_fast_offset_attention_is_the_textbook_one(sharpness: float) -> None:
    query = (sharpness * torch.randn(2, 8, 150, dtype=torch.float64)).requires_grad_()
    value = torch.randn(2, 16, 150, dtype=torch.float64).requires_grad_()

    wanted = textbook_offset_attention(query, value)
    got = offset_attention(query, value)
    torch.testing.assert_close(got, wanted, atol=1e-5, rtol=1e-5)

    # not a plain sum: its gradient would not see the weights
    wanted_gradients = torch.autograd.grad(wanted.sin().sum(), [query, value])
    got_gradients = torch.autograd.grad(got.sin().sum(), [query, value])
    for one, other in zip(got_gradients, wanted_gradients, strict=True):
        torch.testing.assert_close(one, other, atol=1e-5, rtol=1e-5)


def test_attention_columns_are_weights() -> None:
    query = torch.randn(1, 4, 60, dtype=torch.float64)
    ones = torch.ones(1, 1, 60, dtype=torch.float64)
    torch.testing.assert_close(offset_attention(query, ones), ones, atol=1e-6, rtol=0)


def test_a_layer_with_nothing_to_add_is_the_identity() -> None:
    layer = OffsetAttention(8).eval()
    torch.nn.init.zeros_(layer.after[0].weight)
    features = torch.randn(2, 8, 30)
    torch.testing.assert_close(layer(features), features)


def test_permuted_points_get_permuted_scores() -> None:
    network = _small().eval()
    inputs = torch.randn(1, 90, 7)
    order = torch.randperm(90)
    with torch.inference_mode():
        torch.testing.assert_close(
            network(inputs[:, order]), network(inputs)[:, order], atol=1e-5, rtol=1e-5
        )


def test_standardisation_is_part_of_the_network() -> None:
    network = _small().eval()
    inputs = torch.randn(1, 40, 7)
    with torch.inference_mode():
        wanted = network(inputs)
        network.set_standardisation(torch.full((7,), 5.0), torch.full((7,), 3.0))
        torch.testing.assert_close(network(inputs * 3 + 5), wanted, atol=1e-4, rtol=1e-4)


def test_an_outlier_is_clipped() -> None:
    network = _small().eval()
    inputs = torch.randn(1, 40, 7)
    far, farther = inputs.clone(), inputs.clone()
    far[0, 0, 0], farther[0, 0, 0] = 100.0, 1e9
    with torch.inference_mode():
        torch.testing.assert_close(network(far), network(farther))


@pytest.mark.parametrize(
    ("name", "value"), [("inputs", 0), ("classes", 0), ("channels", 6), ("dropout", 1.0)]
)
def test_settings_are_checked(name: str, value: float) -> None:
    settings = {"inputs": 3, "classes": 2, name: value}
    with pytest.raises(ValueError, match=name):
        PctConfig(**settings)  # pyright: ignore[reportArgumentType]
