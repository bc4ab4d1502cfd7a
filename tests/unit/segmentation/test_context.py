from __future__ import annotations

import numpy as np
import pytest

from boltpose.segmentation.context import Neighbourhoods


def _cloud(count: int = 3000) -> np.ndarray:
    return np.random.default_rng(0).uniform(0, 40, (count, 3)) * (1, 1, 0.02)


def test_the_average_of_a_constant_is_the_constant() -> None:
    around = Neighbourhoods(_cloud(), (3.0, 6.0)).average(np.full((3000, 2), 0.25))
    np.testing.assert_allclose(around, 0.25, atol=1e-6)


def test_averages_are_linear_and_stay_in_range() -> None:
    rng = np.random.default_rng(1)
    places = Neighbourhoods(_cloud(), (3.0, 6.0))
    first, second = rng.random((2, 3000, 3))
    np.testing.assert_allclose(
        places.average(2 * first - second),
        2 * places.average(first) - places.average(second),
        atol=1e-5,
    )
    assert places.average(first).min() >= 0
    assert places.average(first).max() <= 1


def test_an_average_is_local() -> None:
    cloud = _cloud()
    left = (cloud[:, :1] < 20).astype(float)
    around = Neighbourhoods(cloud, (3.0, 6.0)).average(left)
    deep = np.abs(cloud[:, 0] - 20) > 9
    np.testing.assert_allclose(around[deep], np.repeat(left[deep], 2, axis=1), atol=1e-6)
    # the larger neighbourhood sees further over the border
    near = np.abs(cloud[:, 0] - 20) < 4
    blur = np.abs(around[near] - left[near]).mean(axis=0)
    assert blur[1] > blur[0]


def test_some_points_can_be_asked_for_alone() -> None:
    cloud, values = _cloud(), np.random.default_rng(2).random((3000, 2))
    index = np.array([7, 2, 2900])
    np.testing.assert_array_equal(
        Neighbourhoods(cloud, (3.0,), at=index).average(values),
        Neighbourhoods(cloud, (3.0,)).average(values)[index],
    )


def test_values_must_belong_to_the_points() -> None:
    with pytest.raises(ValueError, match="3000 rows"):
        Neighbourhoods(_cloud(), (3.0,)).average(np.zeros((2999, 1)))
