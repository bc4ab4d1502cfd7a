from __future__ import annotations

import numpy as np
import pytest

from boltpose.errors import ShapeError
from boltpose.geometry.local_features import (
    FEATURES_PER_RADIUS,
    LocalFeatureConfig,
    compute_local_features,
)
from tests.support.toy_motor import toy_motor

UP = (0.0, 0.0, 1.0)


def _plane(step_mm: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    grid = np.stack(np.meshgrid(*[np.arange(-20, 20, step_mm)] * 2), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))])
    return points, np.tile(UP, (len(points), 1))


def test_a_plane_reads_as_a_plane_at_every_radius() -> None:
    points, normals = _plane()
    inner = np.flatnonzero(np.abs(points).max(axis=1) < 2)

    rows = compute_local_features(points, normals, UP, at=inner).reshape(
        len(inner), -1, FEATURES_PER_RADIUS
    )

    np.testing.assert_allclose(rows[:, :, 2], 0.0, atol=1e-3)  # no third extent
    np.testing.assert_allclose(rows[:, :, 3:10], 0.0, atol=1e-5)  # nothing above or below
    np.testing.assert_allclose(rows[:, :, 10:14], 1.0, atol=1e-5)  # all normals agree


def test_a_pit_has_neighbours_above_and_a_knob_below() -> None:
    points, normals = _plane()
    radius = np.linalg.norm(points[:, :2], axis=1)
    middle = int(np.argmin(radius))
    for sign in (1.0, -1.0):
        bent = points.copy()
        bent[:, 2] = sign * 0.02 * radius**2
        rows = compute_local_features(bent, normals, UP, at=np.array([middle]))
        mean_above = rows.reshape(-1, FEATURES_PER_RADIUS)[:, 3]
        assert (np.sign(mean_above) == sign).all()


def test_a_mirrored_motor_has_the_same_features() -> None:
    motor = toy_motor(density=0.1)
    mirror = np.array([-1.0, 1.0, 1.0])
    original = compute_local_features(motor.points, motor.normals, UP)
    mirrored = compute_local_features(motor.points * mirror, motor.normals * mirror, UP)
    # the thinning grid starts at another corner: equal on average, not point by point
    np.testing.assert_allclose(original.mean(axis=0), mirrored.mean(axis=0), atol=0.02)
    assert np.median(np.abs(original - mirrored)) < 0.02


def test_a_shifted_cloud_has_the_same_features() -> None:
    motor = toy_motor(density=0.1)
    here = compute_local_features(motor.points, motor.normals, UP)
    there = compute_local_features(motor.points + 256.0, motor.normals, UP)
    assert np.quantile(np.abs(here - there), 0.999) < 1e-3


def test_rows_can_be_asked_for_alone() -> None:
    motor = toy_motor(density=0.05)
    index = np.array([400, 3, 77])
    every = compute_local_features(motor.points, motor.normals, UP)
    some = compute_local_features(motor.points, motor.normals, UP, at=index)
    np.testing.assert_array_equal(some, every[index])


def test_a_single_point_is_described_without_nan() -> None:
    rows = compute_local_features([[1.0, 2.0, 3.0]], [[0.0, 0.0, 1.0]], UP)
    assert rows.shape == (1, LocalFeatureConfig().width)
    assert np.isfinite(rows).all()


def test_up_must_be_one_direction_or_one_per_point() -> None:
    with pytest.raises(ShapeError, match="up must have shape"):
        compute_local_features(np.zeros((5, 3)), np.zeros((5, 3)), np.zeros((4, 3)))


@pytest.mark.parametrize("radii", [(), (2.0, 1.0), (0.0, 1.0), (-1.0,), (float("nan"), 2.0)])
def test_radii_must_rise(radii: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="radii_mm"):
        LocalFeatureConfig(radii_mm=radii)
