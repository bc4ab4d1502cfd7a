import numpy as np
import pytest

from boltpose.errors import ShapeError
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import SceneConfig
from boltpose.registration.scene import (
    Standing,
    build_scene,
    free_space_violation,
    judge_surface,
)
from tests.unit.registration.scenes import back_wall, pose, prepared_motor, view

TRUTH = pose(turn=(0.4, 1.9, 0.3))


def shares(scan: np.ndarray, camera_from_prior: Transform) -> np.ndarray:
    scene = build_scene(scan)
    standing = judge_surface(scene, camera_from_prior, prepared_motor(), tolerance_mm=3.0)
    return np.bincount(standing, minlength=5) / len(standing)


def test_the_true_pose_is_confirmed_and_violates_nothing() -> None:
    scan, _ = view(TRUTH)

    share = shares(scan, TRUTH)

    assert share[Standing.CONFIRMED] > 0.15
    assert share[Standing.VIOLATING] == 0.0
    assert share[Standing.OCCLUDED] < 0.01


def test_a_motor_that_is_not_there_is_seen_through() -> None:
    share = shares(back_wall(900.0), TRUTH)

    assert share[Standing.CONFIRMED] == 0.0
    assert share[Standing.OCCLUDED] == 0.0
    assert share[Standing.VIOLATING] > 0.15


def test_a_motor_behind_a_wall_is_occluded_and_violates_nothing() -> None:
    share = shares(back_wall(400.0), TRUTH)

    assert share[Standing.VIOLATING] == 0.0
    assert share[Standing.CONFIRMED] == 0.0
    assert share[Standing.OCCLUDED] > 0.15


def test_directions_without_measurement_are_no_evidence() -> None:
    scan = back_wall(900.0)
    share = shares(scan[scan[:, 0] > 150.0], TRUTH)

    assert share[Standing.UNMEASURED] > 0.15
    assert share[Standing.VIOLATING] == share[Standing.OCCLUDED] == 0.0


def test_violation_is_the_share_of_the_judged_surface() -> None:
    standing = np.array([Standing.VIOLATING] + [Standing.CONFIRMED] * 3 + [Standing.OCCLUDED] * 6)

    assert free_space_violation(standing) == 0.25
    assert free_space_violation(np.array([Standing.NOT_FACING])) == 0.0


def test_an_empty_scan_and_points_behind_the_camera_make_an_empty_scene() -> None:
    for scan in (np.zeros((0, 3)), np.array([[0.0, 0.0, -5.0], [10.0, 0.0, 1.0]])):
        scene = build_scene(scan)
        assert len(scene.points) == 0
        standing = judge_surface(scene, TRUTH, prepared_motor(), tolerance_mm=3.0)
        assert not np.isin(standing, (Standing.CONFIRMED, Standing.VIOLATING)).any()


def test_the_order_of_the_points_makes_no_difference() -> None:
    scan, _ = view(TRUTH)
    shuffled = scan[np.random.default_rng(0).permutation(len(scan))]
    first, second = build_scene(scan), build_scene(shuffled)

    np.testing.assert_array_equal(first.nearest_mm, second.nearest_mm)
    np.testing.assert_array_equal(first.farthest_mm, second.farthest_mm)


def test_large_scans_are_thinned() -> None:
    scene = build_scene(back_wall(), SceneConfig(max_points=1000))

    assert 500 < len(scene.points) <= 1000


def test_points_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ShapeError, match="1 of 2 rows are not"):
        build_scene(np.array([[0.0, 0.0, 1.0], [0.0, np.nan, 1.0]]))


def test_a_scan_in_a_wrong_unit_asks_for_no_more_memory_than_others() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform((-300, -300, 600), (300, 300, 800), (5000, 3))
    scene = build_scene(points * 1000.0)
    assert max(scene.nearest_mm.shape) < 4100
