import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import FrameError
from boltpose.evaluation.poses import (
    LATERAL_LIMIT,
    POSITION_LIMIT,
    PoseRecord,
    compare_with_truth,
    measure_pose_error,
)
from boltpose.geometry.transforms import Transform
from boltpose.schema import Status
from tests.support.strategies import transforms
from tests.unit.evaluation.records import (
    TOPS,
    located,
    perfect_prior,
    shift,
    true_bolts,
    true_view,
    turn_x,
)

TRUE_ID_OF = {f"B{i}": i for i in range(len(TOPS))}
TRUTH = shift("camera", "prior", (10.0, 20.0, 700.0))


def judge(found: Transform, *, status: Status = Status.OK) -> PoseRecord:
    view = true_view(camera_from_prior=TRUTH)
    result = located(perfect_prior(), found, view.base_from_camera, status=status)
    return compare_with_truth(result, view, true_bolts(), TRUE_ID_OF)


def test_the_true_pose_has_no_error() -> None:
    record = judge(TRUTH)

    assert record.pose is not None
    assert record.pose.worst_bolt_mm == pytest.approx(0, abs=1e-9)
    assert record.pose.rotation_rad == pytest.approx(0, abs=1e-9)
    assert record.is_scene_good
    assert not record.is_wrong_accepted
    assert record.missed == ()
    assert all(bolt.error.distance_mm == pytest.approx(0, abs=1e-9) for bolt in record.bolts)
    assert [bolt.is_truly_visible for bolt in record.bolts] == [True, True, False, False]


@given(pose=transforms("camera", "prior"), offset=st.tuples(*[st.floats(-9, 9)] * 3))
def test_a_shift_moves_every_bolt_by_its_length(
    pose: Transform, offset: tuple[float, float, float]
) -> None:
    moved = Transform.from_parts(
        "camera", "prior", pose.rotation, pose.translation_mm + np.array(offset)
    )

    error = measure_pose_error(moved, pose, true_bolts())

    assert error.worst_bolt_mm == pytest.approx(np.linalg.norm(offset), abs=1e-6)
    assert error.worst_axis_rad == pytest.approx(0, abs=1e-9)
    assert error.is_wrong == (error.worst_bolt_mm > 2.0)


def test_a_turn_is_told_by_the_worst_bolt() -> None:
    angle = math.radians(1.0)
    found = TRUTH @ turn_x("prior", "prior", angle)

    error = measure_pose_error(found, TRUTH, true_bolts())

    # about x, the bolts at y = +-40 are farthest from the axis: (0, -40, -70)
    assert error.worst_bolt_mm == pytest.approx(2 * math.sin(angle / 2) * math.hypot(40, 70))
    assert error.worst_axis_rad == pytest.approx(angle)
    assert error.rotation_rad == pytest.approx(angle)
    assert not error.is_wrong


def test_a_roll_that_leaves_the_axes_is_still_wrong() -> None:
    quarter = Transform.from_parts(
        "prior", "prior", np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), (0, 0, 0)
    )

    record = judge(TRUTH @ quarter)

    assert record.pose is not None
    assert record.pose.worst_axis_rad == pytest.approx(0, abs=1e-9)
    # bolts 0, 1, 2 land where an alike bolt is, except one; the partner by id says so
    assert record.pose.worst_bolt_mm == pytest.approx(40 * math.sqrt(2))
    assert record.is_wrong_accepted
    assert not record.is_scene_good
    assert record.bolts[0].error.lateral_mm == pytest.approx(40 * math.sqrt(2))


def test_a_wrong_pose_that_was_refused_is_not_accepted() -> None:
    record = judge(shift("camera", "prior", (0.0, 0.0, 0.0)), status=Status.REFUSED)

    assert record.pose is not None
    assert record.pose.is_wrong
    assert not record.is_wrong_accepted
    assert record.bolts == ()
    assert record.missed == (0, 1, 2, 3)
    assert not record.is_scene_good


def test_an_accepted_result_without_a_pose_counts_as_wrong() -> None:
    record = dataclasses.replace(judge(TRUTH), pose=None)

    assert record.is_wrong_accepted


def test_limits_of_wrong_are_inclusive() -> None:
    record = judge(shift("camera", "prior", (12.0, 20.0, 700.0)))

    assert record.pose is not None
    assert record.pose.worst_bolt_mm == pytest.approx(2.0)
    assert not record.is_wrong_accepted
    assert not record.is_scene_good  # 2 mm lateral is no good scene


def test_a_bolt_missing_from_the_prior_spoils_the_scene() -> None:
    view = true_view(camera_from_prior=TRUTH)
    result = located(perfect_prior(), TRUTH, view.base_from_camera)

    record = compare_with_truth(result, view, true_bolts(), {"B0": 0, "B1": 1, "B2": 2})

    assert record.missed == (3,)
    assert record.false == ("B3",)
    assert not record.is_scene_good
    assert not record.is_wrong_accepted


def test_poses_in_the_camera_frame_are_judged_there() -> None:
    view = true_view(camera_from_prior=TRUTH)

    record = compare_with_truth(
        located(perfect_prior(), TRUTH, None), view, true_bolts(), TRUE_ID_OF
    )

    assert all(bolt.error.distance_mm == pytest.approx(0, abs=1e-9) for bolt in record.bolts)


def test_a_hand_eye_that_was_used_wrongly_is_seen() -> None:
    view = true_view(camera_from_prior=TRUTH)
    result = located(perfect_prior(), TRUTH, shift("base", "camera", (900.0, 100.0, 53.0)))

    record = compare_with_truth(result, view, true_bolts(), TRUE_ID_OF)

    assert [abs(b.error.axial_mm) for b in record.bolts] == pytest.approx([3.0] * 4)
    assert not record.is_wrong_accepted  # the registration itself is right


def test_coverage_follows_the_stated_sigmas() -> None:
    bolt = judge(shift("camera", "prior", (10.2, 20.0, 700.1))).bolts[0]

    assert bolt.error.lateral_mm == pytest.approx(0.2)
    assert bolt.error.axial_mm == pytest.approx(0.1)
    assert bolt.is_lateral_covered  # 2 sigma < 2.45 sigma
    assert bolt.is_axial_covered
    assert bolt.is_axis_covered
    assert bolt.is_position_covered  # 2.24 sigma < 2.80 sigma
    tight = dataclasses.replace(bolt, sigma_lateral_mm=0.2 / (LATERAL_LIMIT * 1.001))
    assert not tight.is_lateral_covered
    assert dataclasses.replace(bolt, sigma_axial_mm=0.05).is_axial_covered is False
    assert bolt.position_sigmas == pytest.approx(math.hypot(2, 1))
    assert not dataclasses.replace(bolt, position_sigmas=POSITION_LIMIT * 1.001).is_position_covered


def test_coverage_limits_are_95_percent_of_normal_errors() -> None:
    errors = np.random.default_rng(0).normal(size=(200_000, 3))

    assert (np.linalg.norm(errors, axis=1) <= POSITION_LIMIT).mean() == pytest.approx(
        0.95, abs=2e-3
    )
    assert (np.linalg.norm(errors[:, :2], axis=1) <= LATERAL_LIMIT).mean() == pytest.approx(
        0.95, abs=2e-3
    )


def test_poses_of_other_frames_are_refused() -> None:
    with pytest.raises(FrameError, match="found is base_from_prior"):
        measure_pose_error(shift("base", "prior", (0.0, 0.0, 0.0)), TRUTH, true_bolts())
