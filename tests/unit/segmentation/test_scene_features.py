from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import ShapeError
from boltpose.segmentation.scene_features import (
    LOCAL_COLUMNS,
    ROTATED_COLUMNS,
    SCENE_WIDTH,
    compute_scene_features,
    find_ground,
)


def _scene(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A plate with a block on it in frame `camera`, and the normal of the tilted plate."""
    rng = np.random.default_rng(seed)
    plate = np.column_stack([rng.uniform(-150, 150, (20000, 2)), np.zeros(20000)])
    block = np.column_stack([rng.uniform(-40, 40, (6000, 2)), np.full(6000, 80.0)])
    camera_from_level = Rotation.from_euler("x", 150, degrees=True).as_matrix()
    points = np.concatenate([plate, block]) @ camera_from_level.T + (0, 0, 700)
    return points, camera_from_level[:, 2]


def test_the_plate_under_the_block_is_the_ground() -> None:
    points, up = _scene()
    described = compute_scene_features(points)
    height = described.features[:, 2] * 100
    true_height = (described.points - (0, 0, 700)) @ up
    np.testing.assert_allclose(height, true_height, atol=1.0)
    assert described.features.shape == (len(described.points), SCENE_WIDTH)


def test_every_point_belongs_to_the_voxel_it_lies_in() -> None:
    points, _ = _scene()
    described = compute_scene_features(points)
    assert np.linalg.norm(points - described.points[described.voxel], axis=1).max() < 5 * 3**0.5


def test_what_stage_one_reads_does_not_turn_with_the_camera() -> None:
    points, _ = _scene()
    roll = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    here = compute_scene_features(points).features[:, LOCAL_COLUMNS]
    there = compute_scene_features(points @ roll.T).features[:, LOCAL_COLUMNS]
    # other voxels, so other points: distributions agree
    for quantile in (0.1, 0.5, 0.9):
        np.testing.assert_allclose(
            np.quantile(here, quantile, axis=0), np.quantile(there, quantile, axis=0), atol=0.06
        )
    turning = {column for columns in ROTATED_COLUMNS for column in columns} - {2, 5}
    assert not turning & set(LOCAL_COLUMNS)


def test_a_view_without_a_plate_gets_a_ground_behind_it() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-100, 100, (2000, 3)) + (0, 0, 700)
    normals = rng.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    up, height = find_ground(points, np.where(normals[:, 2:] > 0, -normals, normals))
    assert np.linalg.norm(up) == pytest.approx(1.0)
    assert (points @ up > height - 12).mean() > 0.85


def test_noise_filling_a_hall_is_thinned_until_it_can_be_handled() -> None:
    noise = np.random.default_rng(0).uniform(-1000, 1000, (120_000, 3)) + (0, 0, 1500)
    described = compute_scene_features(noise)
    assert len(described.points) <= 40000
    assert np.isfinite(described.features).all()


def test_infinite_points_are_refused() -> None:
    with pytest.raises(ShapeError, match="finite"):
        compute_scene_features(np.full((10, 3), np.nan))
