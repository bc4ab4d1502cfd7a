from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boltpose.datasets import part_clouds
from boltpose.datasets.labelled_motors import LabelledCloud
from boltpose.datasets.part_clouds import PartCloudConfig, load_part_clouds
from boltpose.datasets.reman18 import Reman18
from boltpose.datasets.scene_clouds import build_scene_cloud
from boltpose.segmentation.part_features import FEATURE_WIDTH
from boltpose.segmentation.scene_features import SCENE_WIDTH
from tests.support.toy_motor import toy_motor


class _Toys(Reman18):
    """Two toy motors in place of a folder."""

    def __post_init__(self) -> None:
        pass

    @property
    def motors(self) -> tuple[str, ...]:
        return ("motor_0", "motor_1")

    def family(self, motor: str) -> str:
        return f"family_{motor[-1]}"

    def full_scan(self, motor: str) -> LabelledCloud:
        toy = toy_motor(seed=int(motor[-1]), density=0.3)
        return LabelledCloud(points=toy.points, labels=toy.labels)


def test_clouds_come_back_from_disk_as_they_were_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = PartCloudConfig(copies=2)
    made = load_part_clouds(_Toys(root=tmp_path), tmp_path / "cache", config=config)

    def explode(*_: object) -> None:
        raise AssertionError("made again")

    monkeypatch.setattr(part_clouds, "build_part_clouds", explode)
    read = load_part_clouds(_Toys(root=tmp_path), tmp_path / "cache", config=config)

    assert [cloud.motor for cloud in read] == ["motor_0", "motor_0", "motor_1", "motor_1"]
    for one, other in zip(made, read, strict=True):
        np.testing.assert_array_equal(one.features, other.features)
        np.testing.assert_array_equal(one.labels, other.labels)
        np.testing.assert_allclose(one.points, other.points, atol=1e-4)
        assert one.features.shape == (len(one.labels), FEATURE_WIDTH)
    clouds = tuple(made)
    assert len(clouds[1].labels) < len(clouds[0].labels)
    with pytest.raises(AssertionError, match="made again"):
        load_part_clouds(_Toys(root=tmp_path), tmp_path / "cache", config=config, seed=1)


@pytest.mark.parametrize(("name", "value"), [("copies", 0), ("keep_share", (0.9, 0.1))])
def test_settings_are_checked(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        PartCloudConfig(**{name: value})  # pyright: ignore[reportArgumentType]


def test_voxels_of_a_view_account_for_every_point() -> None:
    rng = np.random.default_rng(0)
    plate = np.column_stack([rng.uniform(-150, 150, (20000, 2)), np.full(20000, 700.0)])
    block = np.column_stack([rng.uniform(-40, 40, (5000, 2)), np.full(5000, 620.0)])
    view = LabelledCloud(
        points=np.concatenate([plate, block]), labels=np.repeat([0, 1], [20000, 5000]).astype("u1")
    )

    cloud = build_scene_cloud("motor_0", "a", 0, view)

    assert cloud.counts.sum() == 25000
    assert (cloud.motor_share * cloud.counts).sum() == pytest.approx(5000, rel=1e-3)
    features = cloud.described.features
    assert features.shape == (len(cloud.counts), SCENE_WIDTH)
    # the plate is the ground: height 0, and the block stands 80 mm above it
    motor = cloud.motor_share > 0.5
    np.testing.assert_allclose(features[~motor, 2], 0.0, atol=0.02)
    np.testing.assert_allclose(features[motor, 2], 0.8, atol=0.02)
