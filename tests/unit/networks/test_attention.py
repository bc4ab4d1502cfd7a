from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from boltpose.networks.attention import (
    offset_attention,
    sdpa_offset_attention,
    textbook_offset_attention,
)


@pytest.mark.parametrize("sharpness", [0.3, 1.0])
@pytest.mark.parametrize("form", [offset_attention, sdpa_offset_attention])
def test_fast_offset_attention_is_the_textbook_one(
    form: Callable[[Tensor, Tensor], Tensor], sharpness: float
) -> None:
    dtype = torch.float64 if form is offset_attention else torch.float32
    query = (sharpness * torch.randn(2, 8, 150, dtype=dtype)).requires_grad_()
    value = torch.randn(2, 16, 150, dtype=dtype).requires_grad_()

    wanted = textbook_offset_attention(query, value)
    got = form(query, value)
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


def test_autocast_keeps_the_sums_of_the_sdpa_form() -> None:
    query, value = 2 * torch.randn(1, 8, 100), torch.randn(1, 8, 100)
    wanted = textbook_offset_attention(query, value)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        got = sdpa_offset_attention(query, value)
    torch.testing.assert_close(got, wanted, atol=1e-5, rtol=1e-4)
