import json
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.evaluation.reman18 import list_motors, read_label_image, read_motor
from boltpose.schema import Part
from tests.unit.evaluation.tiny_reman18 import write_tiny_reman18

DATA = Path(__file__).parents[3] / "data" / "reman18"


def test_the_frames_chain_to_the_positions_in_the_files() -> None:
    motor = read_motor(DATA, "motor_004")
    stated = json.loads((DATA / "motor_004" / "bolts.json").read_text())

    assert len(motor.views) == 4
    for view in motor.views:
        base_from_prior = view.base_from_camera @ view.camera_from_prior
        for bolt, entry in zip(motor.bolts, stated[str(view.index)]["bolts"], strict=True):
            top, axis = entry["A"]["head_top"], entry["A"]["axis"]
            np.testing.assert_allclose(base_from_prior.apply(bolt.head_top_mm), top, atol=2e-4)
            np.testing.assert_allclose(base_from_prior.rotate(bolt.axis), axis, atol=2e-6)
            assert view.visibility[bolt.id].is_visible == entry["visible"]


def test_true_axes_point_out_of_their_side_of_the_motor() -> None:
    motor = read_motor(DATA, "motor_009")
    z_axis = motor.prior_from_motor.z_axis

    for bolt in motor.bolts:
        sign = 1 if bolt.side == "top" else -1
        assert bolt.axis @ z_axis * sign > 0.9999


def test_there_are_eighteen_motors_of_six_families() -> None:
    names = list_motors(DATA)
    assert len(names) == 18
    assert len({read_motor(DATA, name).family for name in names}) == 6


def test_label_images_hold_parts() -> None:
    labels = read_label_image(read_motor(DATA, "motor_000").views[0])
    assert labels.shape == (1024, 1224)
    assert set(np.unique(labels)) <= {int(part) for part in Part}
    assert int(Part.BOLT) in labels


def test_a_folder_that_is_no_data_set_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="no folder motor_"):
        list_motors(tmp_path)
    root = write_tiny_reman18(tmp_path)
    (root / "motor_000" / "prior_gt.json").write_text("{}")
    with pytest.raises(InputFileError, match=r"motor_000.*T_M_to_C|motor_000.*bolts"):
        read_motor(root, "motor_000")
