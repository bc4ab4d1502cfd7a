from __future__ import annotations

import numpy as np
import pytest

from boltpose.segmentation.scene_features import ROTATED_COLUMNS, SCENE_WIDTH
from boltpose.training.augmentation import POSITION_ONLY_COLUMNS, PositionVariation
from boltpose.training.scene import SceneConfig, augment

WIDTH = len(POSITION_ONLY_COLUMNS)


def test_a_cloud_is_varied_as_a_whole() -> None:
    columns = np.arange(3 * WIDTH, dtype=np.float32).reshape(3, WIDTH)
    varied = PositionVariation().apply(
        columns, np.ones(WIDTH, dtype=np.float32), (WIDTH,), np.random.default_rng(0)
    )
    steps, wanted = np.diff(varied, axis=0), np.diff(columns, axis=0)
    np.testing.assert_allclose(steps[0] / wanted[0], steps[1] / wanted[1], rtol=1e-4)
    assert (varied != columns).all()


def test_no_variation_changes_nothing() -> None:
    columns = np.ones((5, WIDTH), dtype=np.float32)
    varied = PositionVariation(stretch=0, shift=0).apply(
        columns, np.ones(WIDTH, dtype=np.float32), (5, WIDTH), np.random.default_rng(0)
    )
    np.testing.assert_array_equal(varied, columns)


def test_a_turned_scene_keeps_its_shape() -> None:
    rng = np.random.default_rng(0)
    scene = rng.normal(size=(50, SCENE_WIDTH)).astype(np.float32)
    config = SceneConfig(scale_range=(1.0, 1.0))
    changed = augment(scene, config, np.random.default_rng(1))
    for columns in ROTATED_COLUMNS:
        before, after = scene[:, columns], changed[:, columns]
        distances = np.linalg.norm(before[:1] - before, axis=1)
        np.testing.assert_allclose(
            np.linalg.norm(after[:1] - after, axis=1), distances, rtol=1e-3, atol=1e-4
        )
    # what does not depend on the direction of view stays
    np.testing.assert_array_equal(changed[:, 7:], scene[:, 7:])
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(changed[:, :3], scene[:, :3], atol=0.1)
