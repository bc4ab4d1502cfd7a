"""From the specification of a motor to the bolts of that motor in a clamp, by commands alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from boltpose.cli.app import main
from boltpose.factory.build import build_motor
from boltpose.factory.scene import place_motor
from boltpose.factory.viewpoint import suggest_camera
from boltpose.geometry.transforms import Transform, angle_between_rad
from boltpose.sensor.structured_light import capture_view
from boltpose.sensor.structured_light_config import StructuredLightConfig
from boltpose.synthesis.truth import camera_truth
from boltpose.synthesis.user_model import read_spec
from boltpose.synthesis.write import depth_png_bytes, hand_eye_bytes, json_bytes

BASE_FROM_CAMERA = Transform.from_parts(
    "base", "camera", [[0.0, 1, 0], [1, 0, 0], [0, 0, -1]], (500.0, 100.0, 900.0)
)
SCALE_MM = 0.02


def test_a_motor_written_down_by_hand_is_located(tmp_path: Path) -> None:
    spec_path, model = tmp_path / "bench.json", tmp_path / "model"
    assert (
        main(["synth", "spec", "--family", "planetary_closed", "--seed", "2", "-o", str(spec_path)])
        == 0
    )
    assert main(["synth", "model", str(spec_path), "-o", str(model)]) == 0
    (prior,) = model.glob("*.prior.npz")

    motor = build_motor(read_spec(spec_path))
    scene = place_motor(motor, np.random.default_rng(0), "v_blocks")
    table_from_camera = suggest_camera(scene, np.random.default_rng(1), distance_mm=(600, 650))
    view = capture_view(
        scene.solids, table_from_camera, StructuredLightConfig(), np.random.default_rng(2)
    )
    depth = tmp_path / "scene" / "depth" / "000000.png"
    depth.parent.mkdir(parents=True)
    depth.write_bytes(depth_png_bytes(view.depth_mm, SCALE_MM))
    (tmp_path / "scene" / "scene_camera.json").write_bytes(
        json_bytes({"0": camera_truth(view.camera_matrix, SCALE_MM)})
    )
    hand_eye = tmp_path / "hand_eye.yaml"
    hand_eye.write_bytes(hand_eye_bytes(BASE_FROM_CAMERA.matrix))
    poses = tmp_path / "poses.json"

    code = main(
        [
            *("locate", str(depth), "--prior", str(prior)),
            *("--hand-eye", str(hand_eye), "-o", str(poses)),
        ]
    )

    found = json.loads(poses.read_text())
    assert code == 0, found["verdict"]
    base_from_motor = BASE_FROM_CAMERA @ table_from_camera.inverse() @ scene.table_from_motor
    truth = {bolt.id: bolt for bolt in motor.bolts}
    assert {bolt["id"] for bolt in found["bolts"]} == truth.keys()
    for bolt in found["bolts"]:
        true = truth[bolt["id"]]
        offset = np.array(bolt["head_top"]) - base_from_motor.apply(true.head_top)
        assert np.linalg.norm(offset) < 0.6
        axis = base_from_motor.rotate(true.axis)
        assert np.degrees(angle_between_rad(bolt["axis"], axis)) < 0.5
