"""Several shots of one clamping."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.reflectance import Finish
from boltpose.sensor.structured_light import capture_view
from boltpose.sensor.structured_light_config import StructuredLightConfig
from boltpose.synthesis.run import run_data_set, run_local
from boltpose.synthesis.scene_sample import make_scene_sample
from tests.unit.sensor.shapes import SMALL as SMALL_CAMERA
from tests.unit.sensor.shapes import anywhere, toy_motor
from tests.unit.synthesis.conftest import SMALL

MOTOR = "motor_00000"
ANGLES = 3


@pytest.fixture(scope="module")
def angles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("angles")
    settings = replace(SMALL, views=1, angles=ANGLES, width_px=306, height_px=256)
    run_data_set(root, settings, 1, make_scene_sample, run_local)
    return root / MOTOR


def read(path: Path) -> Any:
    return json.loads(path.read_text())


def test_all_shots_show_the_motor_in_one_place_from_different_places(angles: Path) -> None:
    scenes = read(angles / "scene_gt.json")
    assert sorted(scenes) == ["0", "1", "2"]
    base_from_camera = [
        Transform("base", "camera", np.array(scenes[key][0]["T_B_to_A"])) for key in sorted(scenes)
    ]
    base_from_prior = [
        pose @ Transform("camera", "prior", np.array(scenes[key][0]["T_C_to_B"]))
        for key, pose in zip(sorted(scenes), base_from_camera, strict=True)
    ]
    for pose in base_from_prior[1:]:
        np.testing.assert_allclose(pose.matrix, base_from_prior[0].matrix, atol=1e-5)
    for one, two in combinations(base_from_camera, 2):
        assert one.z_axis @ two.z_axis < np.cos(np.radians(20))
        assert rotation_angle_rad(one.rotation.T @ two.rotation) > np.radians(20)


def test_all_shots_are_of_one_clamping_by_one_camera(angles: Path) -> None:
    views = read(angles / "bolts.json")
    assert {view["clamping"] for view in views.values()} == {0}
    assert len({json.dumps(view["changes"]) for view in views.values()}) == 1
    cameras = read(angles / "scene_camera.json")
    assert len({json.dumps(camera["cam_K"]) for camera in cameras.values()}) == 1


def test_the_first_shot_is_the_view_that_would_be_alone(angles: Path, tmp_path: Path) -> None:
    settings = replace(SMALL, views=1, width_px=306, height_px=256)
    run_data_set(tmp_path, settings, 1, make_scene_sample, run_local)
    for name in ("depth/000000.png", "label/000000.png", "hand_eye/000000.yaml", "prior.ply"):
        assert (tmp_path / MOTOR / name).read_bytes() == (angles / name).read_bytes()


def test_what_lasts_from_shot_to_shot_is_the_error_of_the_camera() -> None:
    # no noise and no lost pixels: all that is left is what must be the same
    config = replace(
        StructuredLightConfig(camera=SMALL_CAMERA, working_distance_mm=600, ripple_mm=0.2),
        noise_mm=0,
        dropout_spread=0,
        mixed_share=0,
        finish=Finish(),
    )
    caster, pose = RayCaster(toy_motor()), anywhere(3, 600)
    one, two, three = (
        capture_view(
            caster,
            pose,
            config,
            np.random.default_rng(seed),
            lasting_rng=None if lasting is None else np.random.default_rng(lasting),
        ).depth_mm
        for seed, lasting in ((1, None), (2, 1), (2, None))
    )
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - three).max() > 0.05
