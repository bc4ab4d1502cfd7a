from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.sensor.depth_filters import (
    binomial_noise_gain,
    mix_edges,
    remove_lone_pixels,
    smooth_depth,
)


@given(
    slope=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    strength=st.floats(0, 1),
    seed=st.integers(0, 1000),
)
def test_smoothing_leaves_planes_and_holes(
    slope: tuple[float, float], strength: float, seed: int
) -> None:
    rows, columns = np.mgrid[0:20, 0:30]
    image = 500 + slope[0] * rows + slope[1] * columns
    image[np.random.default_rng(seed).random(image.shape) < 0.2] = 0
    before = image.copy()

    smooth_depth(image, strength, 1.5)

    np.testing.assert_allclose(image, before, atol=1e-4)
    np.testing.assert_array_equal(image == 0, before == 0)


@pytest.mark.parametrize("strength", [0.0, 0.5, 1.0])
def test_smoothing_shrinks_noise_by_its_gain(strength: float) -> None:
    image = 700 + 0.05 * np.random.default_rng(0).standard_normal((400, 400))

    smooth_depth(image, strength, 1.5)

    inner = image[1:-1, 1:-1]
    assert inner.std() == pytest.approx(0.05 * binomial_noise_gain(strength), rel=0.02)


def test_smoothing_keeps_steps() -> None:
    image = np.full((20, 20), 500.0)
    image[:, 10:] = 505.0
    before = image.copy()

    smooth_depth(image, 1.0, 1.5)

    np.testing.assert_array_equal(image, before)


def test_mixed_pixels_lie_between_the_two_sides_of_an_edge() -> None:
    image = np.full((200, 40), 500.0)
    image[:, 20:] = 530.0
    image[:, 30:] = 0
    before = image.copy()

    mix_edges(image, 1.5, 0.3, np.random.default_rng(0))

    changed = image != before
    assert not changed[:, :19].any()
    assert not changed[:, 21:].any()
    assert ((image[changed] > 500) & (image[changed] < 530)).all()
    assert 0.2 < changed[:, 19:21].sum() / 200 < 0.4


def test_lone_pixels_go_and_surfaces_stay() -> None:
    image = np.zeros((20, 20))
    image[:, :10] = 500.0
    image[5, 5] = 520.0
    image[10, 15] = 500.0

    remove_lone_pixels(image, 3.0, 3)

    expected = np.zeros((20, 20))
    expected[:, :10] = 500.0
    expected[5, 5] = 0
    expected[0, 0] = expected[-1, 0] = 500.0
    np.testing.assert_array_equal(image, expected)
