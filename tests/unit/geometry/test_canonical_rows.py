from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.geometry import sampling
from boltpose.geometry.sampling import canonical_rows

CLOUD = np.random.default_rng(0).normal(scale=100, size=(5000, 3))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), at_most=st.sampled_from([None, 10, 800, 5000]))
def test_any_order_of_the_points_gives_the_same_points_in_the_same_order(
    seed: int, at_most: int | None
) -> None:
    mixed = CLOUD[np.random.default_rng(seed).permutation(len(CLOUD))]
    np.testing.assert_array_equal(
        mixed[canonical_rows(mixed, at_most)], CLOUD[canonical_rows(CLOUD, at_most)]
    )


def test_all_points_are_kept_once_or_as_many_as_wanted() -> None:
    assert sorted(canonical_rows(CLOUD)) == list(range(len(CLOUD)))
    chosen = canonical_rows(CLOUD, 700)
    assert len(set(chosen)) == len(chosen) == 700


def test_the_choice_is_even() -> None:
    """No part of space is preferred, also on a grid of few different coordinates."""
    ticks = np.arange(100.0)
    grid = np.stack(np.meshgrid(ticks, ticks, ticks[:1]), axis=-1).reshape(-1, 3)
    chosen = grid[canonical_rows(grid, 2500)]
    counts = np.histogram2d(chosen[:, 0], chosen[:, 1], bins=4, range=[[0, 100], [0, 100]])[0]
    # 156 expected per bin, hypergeometric sigma 10.5
    assert np.abs(counts - 2500 / 16).max() < 5 * 10.5


def test_equal_points_and_equal_keys_still_have_one_order(monkeypatch: pytest.MonkeyPatch) -> None:
    doubled = np.repeat(CLOUD, 2, axis=0)
    assert len(canonical_rows(doubled, 101)) in (101, 102)
    monkeypatch.setattr(sampling, "_hash_rows", lambda cloud: np.zeros(len(cloud), np.uint64))
    flat = CLOUD % 4.0  # all in one cell: nothing but the fallback tells them apart
    mixed = flat[::-1].copy()
    np.testing.assert_array_equal(mixed[canonical_rows(mixed)], flat[canonical_rows(flat)])


def test_minus_zero_is_zero() -> None:
    zeros, minus = np.zeros((3, 3)), np.zeros((3, 3))
    zeros[:, 0] = minus[:, 0] = (1.0, 2.0, 3.0)
    minus[:, 1] = -0.0
    np.testing.assert_array_equal(canonical_rows(zeros), canonical_rows(minus))


def test_no_points_and_no_choice() -> None:
    assert len(canonical_rows(np.zeros((0, 3)), 10)) == 0
    with pytest.raises(ValueError, match="at_most must be > 0"):
        canonical_rows(CLOUD, 0)
