import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.geometry.transforms import rotation_angle_rad
from boltpose.registration.batch import (
    PoseBatch,
    rotations_from_vectors,
    score_batch,
    step_batch,
)
from boltpose.registration.coarse import distinct_rows, register_coarsely, start_poses
from boltpose.registration.config import CoarseConfig
from tests.unit.registration.scenes import pose, pose_error, prepared_motor, visible_points

CONFIG = CoarseConfig()


def batch_of(*poses) -> PoseBatch:
    inverse = [camera_from_prior.inverse() for camera_from_prior in poses]
    return PoseBatch(
        np.stack([item.rotation for item in inverse]),
        np.stack([item.translation_mm for item in inverse]),
    )


@pytest.mark.parametrize("turn", [(0.4, 1.9, 0.3), (-1.2, 0.5, 2.0), (2.6, 0.2, -0.9)])
def test_the_best_candidate_is_right_whatever_the_orientation(turn) -> None:
    truth = pose(turn=turn)

    result = register_coarsely(prepared_motor(), visible_points(truth), CONFIG)

    best = result.poses.transforms()[0]
    assert pose_error(best, truth) < 3.0
    assert not result.used_offsets
    assert (np.diff(result.scores) <= 0).all()


def test_the_number_of_threads_changes_no_bit() -> None:
    points = visible_points(pose(turn=(0.4, 1.9, 0.3)))

    one = register_coarsely(prepared_motor(), points, CoarseConfig(threads=1))
    three = register_coarsely(prepared_motor(), points, CoarseConfig(threads=3))

    np.testing.assert_array_equal(one.poses.rotations, three.poses.rotations)
    np.testing.assert_array_equal(one.poses.translations_mm, three.poses.translations_mm)


def test_a_patch_of_foreign_points_is_survived_by_shifted_starts() -> None:
    truth = pose(turn=(0.4, 1.9, 0.3))
    motor = visible_points(truth)
    grid = np.arange(-60.0, 60.0, 1.5)
    x, y = (part.ravel() for part in np.meshgrid(grid, grid))
    plate = np.stack([x + 110.0, y, np.full_like(x, 640.0)], axis=1)
    assert np.linalg.norm(np.vstack([motor, plate]).mean(axis=0) - motor.mean(axis=0)) > 20.0

    result = register_coarsely(prepared_motor(), np.vstack([motor, plate]), CONFIG)

    assert result.used_offsets
    assert pose_error(result.poses.transforms()[0], truth) < 3.0


def test_start_poses_look_from_every_direction_and_align_the_seen_centroid() -> None:
    prepared = prepared_motor()
    centroid = np.array([10.0, -20.0, 650.0])

    starts = start_poses(prepared, centroid, 5)

    assert len(starts) == 5 * len(prepared.view_directions)
    np.testing.assert_allclose(
        starts.rotations @ starts.rotations.transpose(0, 2, 1),
        np.broadcast_to(np.eye(3), starts.rotations.shape),
        atol=1e-12,
    )
    np.testing.assert_allclose(np.linalg.det(starts.rotations), 1.0)
    seen = starts.rotations @ centroid + starts.translations_mm
    np.testing.assert_allclose(seen, np.repeat(prepared.view_centroids, 5, axis=0), atol=1e-9)
    towards = starts.rotations @ (-centroid / np.linalg.norm(centroid))
    np.testing.assert_allclose(towards, np.repeat(prepared.view_directions, 5, axis=0), atol=1e-9)


def test_a_step_brings_a_near_pose_nearer_and_leaves_the_true_one() -> None:
    truth = pose(turn=(0.4, 1.9, 0.3))
    near = pose(turn=(0.42, 1.9, 0.3))
    points = visible_points(truth)[::40].astype(np.float32)
    poses = batch_of(truth, near)
    for _ in range(8):
        poses = step_batch(poses, points, prepared_motor(), 5.0)

    still, moved = poses.transforms()
    assert pose_error(still, truth) < 0.3
    assert pose_error(moved, truth) < 0.3 < pose_error(near, truth)


def test_the_score_is_near_one_at_the_truth_and_lower_elsewhere() -> None:
    truth = pose(turn=(0.4, 1.9, 0.3))
    other = pose(turn=(0.4, 1.9, 1.3))
    points = visible_points(truth)[::20].astype(np.float32)

    good, bad = score_batch(batch_of(truth, other), points, prepared_motor(), 1.0)

    assert good > 0.9
    assert bad < 0.5


def test_rotation_vectors_become_the_matrices_of_scipy() -> None:
    vectors = np.random.default_rng(0).normal(size=(50, 3))
    vectors[0] = 0.0

    np.testing.assert_allclose(
        rotations_from_vectors(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-12
    )


def test_distinct_rows_keep_the_best_of_each_cluster() -> None:
    first = pose(turn=(0.4, 1.9, 0.3))
    twin = pose(turn=(0.41, 1.9, 0.3))
    far = pose(turn=(0.4, 1.9, 0.9))
    assert rotation_angle_rad(first.rotation.T @ twin.rotation) < CONFIG.cluster_angle_rad

    rows = distinct_rows(batch_of(first, twin, far), np.array([0.6, 0.8, 0.7]), np.zeros(3), CONFIG)

    assert rows.tolist() == [1, 2]
