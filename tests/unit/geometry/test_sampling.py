from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import ShapeError
from boltpose.geometry.sampling import (
    group_means,
    voxel_downsample,
    voxel_groups,
    voxel_representatives,
)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 300), voxel_mm=st.floats(0.5, 50))
def test_every_point_lies_in_the_voxel_of_its_group(seed: int, count: int, voxel_mm: float) -> None:
    points = np.random.default_rng(seed).uniform(-100, 100, (count, 3))
    group = voxel_groups(points, voxel_mm)
    assert set(group) == set(range(group.max() + 1))
    cells = np.floor((points - points.min(axis=0)) / voxel_mm)
    same_cell = (cells[:, None] == cells[None]).all(axis=2)
    np.testing.assert_array_equal(same_cell, group[:, None] == group[None])


@given(seed=st.integers(0, 2**32 - 1))
def test_means_keep_the_centre_of_mass(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(200, 3)) * 30
    group = voxel_groups(points, 7.0)
    counts = np.bincount(group)
    np.testing.assert_allclose(
        counts @ group_means(points, group) / len(points), points.mean(axis=0), atol=1e-9
    )


def test_representatives_are_points_of_their_voxel_nearest_to_its_mean() -> None:
    points = np.array([[0.0, 0, 0], [0.4, 0, 0], [0.5, 0, 0], [5.0, 0, 0]])
    np.testing.assert_array_equal(voxel_representatives(points, 1.0), [1, 3])
    np.testing.assert_allclose(voxel_downsample(points, 1.0), [[0.3, 0, 0], [5.0, 0, 0]])


def test_bad_arguments_are_named() -> None:
    with pytest.raises(ValueError, match="voxel_mm must be > 0, got nan"):
        voxel_groups(np.zeros((3, 3)), float("nan"))
    with pytest.raises(ShapeError, match=r"points must have shape \(N, 3\), got \(3, 2\)"):
        voxel_groups(np.zeros((3, 2)), 1.0)
    with pytest.raises(ShapeError, match="1 of 3 rows are not"):
        voxel_groups(np.array([[0, 0, 0], [1, 1, np.nan], [2, 2, 2]]), 1.0)
