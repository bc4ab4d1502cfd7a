import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.errors import InputFileError
from boltpose.evaluation.peers_methods import METHODS, OURS, PEERS
from boltpose.evaluation.peers_records import (
    FOLDER,
    FORMAT,
    Failure,
    Judgement,
    Mask,
    PeerCase,
    PeerFile,
    classify_failure,
    peer_path,
    pose_of,
    read_peer_file,
    write_peer_file,
)
from boltpose.evaluation.peers_report import sections
from boltpose.evaluation.peers_views import CLAMP_SHARE, add_clamp
from boltpose.evaluation.poses import PoseError
from boltpose.evaluation.records import Environment
from boltpose.geometry.transforms import Transform
from boltpose.schema import Status
from tests.support.strategies import transforms
from tests.unit.evaluation.records import true_motor, true_view

ENVIRONMENT = Environment(
    version="1", commit="abc", python="3.11", numpy="2", machine="Linux", cores=2
)


def classify(
    truth: Transform,
    prior_from_motor: Transform,
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Failure:
    """Move the motor in its own frame and ask how the pose is wrong."""
    view = true_view(camera_from_prior=truth)
    motor = dataclasses.replace(
        true_motor("motor_000", "a", (view,)), prior_from_motor=prior_from_motor
    )
    moved = Transform.from_parts(
        "motor", "motor", Rotation.from_rotvec(turn).as_matrix(), np.array(offset)
    )
    found = truth @ prior_from_motor @ moved @ prior_from_motor.inverse()
    return classify_failure(found, motor, view)


def case(view: int = 0, **changes: object) -> PeerCase:
    known = PeerCase(
        motor="motor_000",
        view=view,
        mark="m",
        pose=tuple(float(x) for x in np.eye(4)[:3].ravel()),
        error=PoseError(worst_bolt_mm=0.125, worst_axis_rad=0.0, rotation_rad=0.0),
        failure=Failure.RIGHT,
        fit_mm=0.0755,
        is_claimed=True,
        cpu_s=1.5,
        wall_s=2.5,
        judgement=Judgement(status=Status.OK, failed=(), p_correct=0.99, cpu_s=0.1),
        judgement_mark="j",
    )
    return dataclasses.replace(known, **changes)


def peer_file(method: str, *cases: PeerCase, mask: Mask = Mask.NETWORK) -> PeerFile:
    return PeerFile(
        format=FORMAT,
        method=method,
        mask=mask,
        version="1.2",
        environment=ENVIRONMENT,
        cases=cases,
    )


WRONG = case(
    1,
    failure=Failure.ROLL,
    error=PoseError(worst_bolt_mm=55.0, worst_axis_rad=0.0, rotation_rad=1.0),
    fit_mm=0.0744,
    judgement=Judgement(status=Status.REFUSED, failed=("poor_fit",), p_correct=0.0, cpu_s=0.1),
)


@given(
    truth=transforms("camera", "prior"),
    prior_from_motor=transforms("prior", "motor"),
    roll_deg=st.floats(6, 354),
    slide_mm=st.floats(-50, 50),
)
def test_turned_about_the_axis_is_a_roll_slid_or_not(
    truth: Transform, prior_from_motor: Transform, roll_deg: float, slide_mm: float
) -> None:
    turn = (0.0, 0.0, math.radians(roll_deg))

    assert classify(truth, prior_from_motor, turn, (0, 0, slide_mm)) is Failure.ROLL


@given(
    truth=transforms("camera", "prior"),
    prior_from_motor=transforms("prior", "motor"),
    along_mm=st.floats(3, 50),
    across=st.floats(0, 0.9),
)
def test_moved_along_the_axis_more_than_across_is_a_slide(
    truth: Transform, prior_from_motor: Transform, along_mm: float, across: float
) -> None:
    slid = classify(truth, prior_from_motor, offset=(across * along_mm, 0, -along_mm))
    moved = classify(truth, prior_from_motor, offset=(along_mm, 0, across * along_mm))

    assert slid is Failure.SLIDE
    assert moved is Failure.OTHER


@given(
    truth=transforms("camera", "prior"),
    prior_from_motor=transforms("prior", "motor"),
    across_rad=st.floats(0, 2 * math.pi),
    angle_deg=st.floats(21, 180),
)
def test_end_over_end_is_a_flip_and_less_is_other(
    truth: Transform, prior_from_motor: Transform, across_rad: float, angle_deg: float
) -> None:
    axis = np.array([math.cos(across_rad), math.sin(across_rad), 0.0])
    turn = tuple(float(x) for x in math.radians(angle_deg) * axis)
    if abs(angle_deg - 135.0) < 1e-6:
        return

    found = classify(truth, prior_from_motor, turn)

    assert found is (Failure.FLIP if angle_deg > 135 else Failure.OTHER)


@given(truth=transforms("camera", "prior"), prior_from_motor=transforms("prior", "motor"))
def test_a_pose_within_two_millimetres_is_right(
    truth: Transform, prior_from_motor: Transform
) -> None:
    assert classify(truth, prior_from_motor, offset=(0, 0, 1.99)) is Failure.RIGHT
    assert classify(truth, prior_from_motor, offset=(0, 0, 2.01)) is Failure.SLIDE


@given(seed=st.integers(0, 2**32), motor=st.integers(40, 300))
def test_a_fifth_of_the_spoiled_mask_is_one_patch_of_the_clamp(seed: int, motor: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(600, 3))
    is_motor = rng.permutation(600) < motor

    spoiled = add_clamp(points, is_motor, np.random.default_rng(seed))

    added = spoiled & ~is_motor
    assert (spoiled | ~is_motor).all()
    assert abs(added.sum() - CLAMP_SHARE * spoiled.sum()) <= 1
    centres = points[added]
    left = points[~spoiled]
    reach = np.linalg.norm(centres[:, None] - centres[None], axis=2).max(axis=1)
    outside = np.linalg.norm(centres[:, None] - left[None], axis=2).min(axis=1)
    # one of its points is the seed: nothing left out is nearer to it than anything added
    assert (reach <= outside).any()
    np.testing.assert_array_equal(spoiled, add_clamp(points, is_motor, np.random.default_rng(seed)))


def test_records_come_back_as_they_were_written(tmp_path) -> None:
    no_pose = case(
        2, pose=(), error=None, failure=Failure.NO_POSE, fit_mm=None, judgement=None, wall_s=0.1
    )
    record = peer_file("kiss", case(), WRONG, no_pose)

    write_peer_file(tmp_path, record)

    assert read_peer_file(peer_path(tmp_path, "kiss", Mask.NETWORK)) == record
    pose = pose_of(record.cases[0])
    assert pose is not None
    np.testing.assert_array_equal(pose.matrix, np.eye(4))
    assert pose_of(no_pose) is None


def test_another_file_is_no_record(tmp_path) -> None:
    path = peer_path(tmp_path, "kiss", Mask.NETWORK)
    write_peer_file(tmp_path, dataclasses.replace(peer_file("kiss"), format="boltpose.peers/0"))

    with pytest.raises(InputFileError, match=r"peers/0.*peers/1"):
        read_peer_file(path)


def test_every_method_has_one_name() -> None:
    assert len(set(METHODS)) == len(METHODS) == len(PEERS) + 1
    assert METHODS[-1] == OURS


def test_the_report_says_where_others_are_better_and_who_notices(tmp_path) -> None:
    folder = tmp_path / FOLDER
    folder.mkdir()
    slow = case(1, cpu_s=9.0)
    write_peer_file(folder, peer_file("kiss", case(cpu_s=0.25), dataclasses.replace(WRONG)))
    write_peer_file(folder, peer_file(OURS, case(), slow))

    text = "\n".join(sections(tmp_path))

    assert "| KISS-Matcher, 3 mm (2 views only) | 1 / 2 | 1 |" in text
    assert "| KISS-Matcher, 3 mm | 1 | 0 | 1 | 0 | 0 / 1 |" in text
    assert "faster (0.88 against 5.25 CPU s)" in text
    assert "smaller" not in text
    assert "0.0755 mm (median) for the right poses of others, 0.0744 mm" in text


def test_nothing_measured_is_no_section(tmp_path) -> None:
    assert sections(tmp_path) == []
