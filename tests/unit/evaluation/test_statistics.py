import numpy as np
import pytest

from boltpose.evaluation.statistics import share_of, spread_of


def test_a_list_in_three_numbers() -> None:
    spread = spread_of(float(value) for value in range(101))

    assert spread is not None
    assert (spread.count, spread.median, spread.p95, spread.maximum) == (101, 50, 95, 100)


def test_nothing_has_no_median() -> None:
    assert spread_of([]) is None
    assert share_of([]) is None


def test_a_nan_does_not_hide_in_a_median() -> None:
    with pytest.raises(ValueError, match="1 of 3 are not finite"):
        spread_of([1.0, np.nan, 2.0])


def test_shares() -> None:
    assert share_of([True, False, False, True]) == 0.5
