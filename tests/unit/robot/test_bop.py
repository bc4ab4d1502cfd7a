from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, FrameError, PosesRefusedError
from boltpose.geometry.transforms import Transform
from boltpose.robot import BopTarget, bop_text
from boltpose.robot.bop import total_seconds
from tests.support import records, results

TARGET = BopTarget(scene_id=12, im_id=7, obj_id=3)


def read_bop(text: str):
    """A reader from the specification: header line, 7 columns, numbers in R and t by spaces."""
    header, *lines = text.rstrip("\n").split("\n")
    assert header == "scene_id,im_id,obj_id,score,R,t,time"
    rows = []
    for line in lines:
        scene_id, im_id, obj_id, score, rotation, translation, seconds = line.split(",")
        rows.append(
            (
                (int(scene_id), int(im_id), int(obj_id)),
                float(score),
                np.array([float(part) for part in rotation.split(" ")]).reshape(3, 3),
                np.array([float(part) for part in translation.split(" ")]).reshape(3, 1),
                float(seconds),
            )
        )
    return rows


def located(seed: int = 4):
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    camera_from_prior = Transform.from_parts("camera", "prior", turn, (-12.25, 30.5, 812.125))
    accepted = results.located(results.cube_prior())
    return replace(
        accepted,
        registration=records.registration(camera_from_prior),
        verdict=replace(accepted.verdict, p_correct=0.91),
    )


def test_the_motor_in_the_camera_bit_for_bit() -> None:
    result = located()
    ((numbers, score, rotation, translation, seconds),) = read_bop(
        bop_text(result, TARGET, seconds=1.25)
    )
    pose = result.registration.camera_from_prior
    assert numbers == (12, 7, 3)
    assert score == 0.91
    assert seconds == 1.25
    np.testing.assert_array_equal(rotation, pose.rotation)
    np.testing.assert_array_equal(translation[:, 0], pose.translation_mm)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    # what BOP does with it: points of the model, mm, into the camera
    points = np.array([[1.0, 2.0, 3.0], [-40.0, 5.0, 60.0]])
    np.testing.assert_allclose((rotation @ points.T + translation).T, pose.apply(points))


def test_a_model_in_another_frame() -> None:
    result = located()
    prior_from_motor = Transform.from_parts(
        "prior", "motor", Rotation.from_euler("x", 30, degrees=True).as_matrix(), (5, 6, 7)
    )
    ((_, _, rotation, translation, _),) = read_bop(
        bop_text(result, TARGET, prior_from_model=prior_from_motor)
    )
    point = np.array([10.0, -20.0, 30.0])
    wanted = result.registration.camera_from_prior.apply(prior_from_motor.apply(point))
    np.testing.assert_allclose(rotation @ point + translation[:, 0], wanted)
    with pytest.raises(FrameError):
        bop_text(result, TARGET, prior_from_model=prior_from_motor.inverse())


def test_it_needs_no_hand_eye() -> None:
    in_camera = replace(located(), frame="camera", base_from_camera=None)
    assert bop_text(in_camera, TARGET) == bop_text(located(), TARGET)


def test_a_refused_result_is_no_estimate() -> None:
    # although it holds a candidate
    with pytest.raises(PosesRefusedError, match="leave its row out"):
        bop_text(results.refused(results.cube_prior()), TARGET)


def test_unknown_time_is_minus_one() -> None:
    assert total_seconds([]) == -1.0
    assert total_seconds([1000.0, 250.0]) == 1.25
    assert read_bop(bop_text(located(), TARGET))[0][4] == -1.0


def test_numbers_of_the_benchmark_are_not_negative() -> None:
    with pytest.raises(ConfigError, match="im_id must be 0 or more, got -1"):
        BopTarget(scene_id=0, im_id=-1, obj_id=1)
