from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.errors import ShapeError
from boltpose.segmentation.reliability import (
    BINS,
    measure_reliability,
    most_probable,
    scale_probabilities,
)


def test_statements_that_come_true_as_often_as_stated_have_no_error() -> None:
    rng = np.random.default_rng(0)
    stated = rng.random(60000)
    measured = measure_reliability(stated, rng.random(60000) < stated)
    assert measured.expected_error < 0.01
    assert measured.brier == pytest.approx(1 / 6, abs=0.01)  # mean of p (1 - p)


@pytest.mark.parametrize("overstated", [0.1, 0.25])
def test_a_constant_overstatement_is_the_error(overstated: float) -> None:
    rng = np.random.default_rng(1)
    right = 0.5 * rng.random(60000)
    measured = measure_reliability(right + overstated, rng.random(60000) < right)
    assert measured.expected_error == pytest.approx(overstated, abs=0.01)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60))
def test_every_statement_falls_into_the_bin_of_its_probability(
    statements: list[tuple[float, bool]],
) -> None:
    stated = np.array([probability for probability, _ in statements])
    measured = measure_reliability(stated, np.array([is_true for _, is_true in statements]))
    assert len(measured.bins) == BINS
    assert measured.count == len(statements)
    for entry in measured.bins:
        if entry.count:
            assert entry.low - 1e-9 <= entry.mean_probability <= entry.high + 1e-9
    assert 0 <= measured.expected_error <= 1


@pytest.mark.parametrize(
    ("stated", "is_true"),
    [([], []), ([0.5, 0.5], [True]), ([1.2], [True]), ([float("nan")], [True])],
)
def test_what_is_no_probability_is_refused(stated: list[float], is_true: list[bool]) -> None:
    with pytest.raises(ShapeError, match="probability"):
        measure_reliability(np.array(stated, float), np.array(is_true, bool))


def test_a_temperature_changes_no_order_and_one_changes_nothing() -> None:
    rows = np.random.default_rng(2).dirichlet(np.ones(6), size=200)
    np.testing.assert_allclose(scale_probabilities(rows, 1.0), rows, atol=1e-9)
    soft = scale_probabilities(rows, 2.0)
    np.testing.assert_allclose(soft.sum(axis=1), 1.0)
    np.testing.assert_array_equal(soft.argsort(axis=1), rows.argsort(axis=1))
    assert (soft.max(axis=1) <= rows.max(axis=1) + 1e-12).all()


def test_the_most_probable_class_is_judged() -> None:
    rows = np.array([[0.7, 0.3], [0.4, 0.6]])
    probability, is_right = most_probable(rows, np.array([0, 0]))
    np.testing.assert_array_equal(probability, [0.7, 0.6])
    np.testing.assert_array_equal(is_right, [True, False])
