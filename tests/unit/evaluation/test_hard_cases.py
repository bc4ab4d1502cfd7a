import math
from dataclasses import replace

import numpy as np
import pytest

from boltpose.evaluation.hard_cases import HardView, list_hard_cases
from boltpose.evaluation.hard_poses import list_few_misses, list_mirror_poses, list_near_misses
from boltpose.evaluation.hard_records import HardCase
from boltpose.evaluation.poses import measure_pose_error
from boltpose.geometry.transforms import Transform
from tests.unit.evaluation.hard_samples import TRUTH, scene, true_bolts
from tests.unit.registration.scenes import prepared_motor


@pytest.fixture(scope="module")
def hard() -> HardView:
    return HardView(
        number=0,
        view=0,
        scene=scene(),
        true_bolts=true_bolts(),
        prepared=prepared_motor(),
        prior_from_motor=Transform.identity("prior", "motor"),
        other_sizes={"other": prepared_motor(1.05)},
        strangers={},
        neighbour=None,
        network=None,
    )


@pytest.fixture(scope="module")
def cases(hard: HardView) -> list[HardCase]:
    return list(list_hard_cases(hard, is_thorough=False))


def test_every_near_miss_is_as_far_off_as_it_says(hard: HardView) -> None:
    rng = np.random.default_rng(0)
    for miss in list_near_misses(TRUTH, hard.prepared, rng):
        if miss.is_refined:
            continue
        error = measure_pose_error(miss.camera_from_prior, TRUTH, hard.true_bolts)
        found = math.degrees(error.rotation_rad)
        if miss.kind in ("moved", "slid"):
            found = error.worst_bolt_mm
        assert found == pytest.approx(abs(miss.size), abs=1e-6)


def test_all_few_misses_are_wrong_or_starts_of_a_refinement(hard: HardView) -> None:
    for miss in list_few_misses(TRUTH, hard.prepared, np.random.default_rng(0)):
        error = measure_pose_error(miss.camera_from_prior, TRUTH, hard.true_bolts)
        is_wrong = error.worst_bolt_mm > 2.0 or math.degrees(error.rotation_rad) > 2.0
        assert is_wrong


def test_a_mirrored_motor_lies_on_the_prior_where_it_is_symmetric(hard: HardView) -> None:
    # the housing is symmetric in every plane through its axis: a point of it and its partner
    on_axis = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50.0], [0.0, 46.0, 0.0]])
    mirrored = TRUTH.apply(on_axis) * (-1.0, 1.0, 1.0)

    in_x, _, _ = list_mirror_poses(TRUTH, hard.prior_from_motor)

    assert np.linalg.det(in_x.camera_from_prior.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(in_x.camera_from_prior.apply(on_axis), mirrored, atol=1e-9)


def test_a_view_gives_right_and_wrong_cases_of_every_kind(cases: list[HardCase]) -> None:
    kinds = {(case.kind, case.is_wrong) for case in cases}

    assert ("located", False) in kinds
    assert {("moved, raw", True), ("slid, raw", True), ("other size", True)} <= kinds
    assert all(case.evidence is not None for case in cases)


def test_another_prior_is_wrong_wherever_it_is_put(cases: list[HardCase]) -> None:
    others = [case for case in cases if case.scene == "other size"]

    assert others
    assert all(case.worst_bolt_mm == math.inf and case.is_wrong for case in others)


def test_located_poses_are_right_and_fit_better_than_raw_wrong_ones(cases: list[HardCase]) -> None:
    located = [c.evidence for c in cases if c.pose == "located" and not c.is_wrong]
    wrong = [c.evidence for c in cases if c.is_wrong and c.pose.endswith("raw")]

    assert min(e.weakest_tight for e in located if e) > max(e.weakest_tight for e in wrong if e)


def test_the_same_view_gives_the_same_cases(hard: HardView) -> None:
    # the cases of other priors only: a second time all of them would cost more than it tells
    quick = replace(hard, other_sizes={})
    first = [
        case for case, _ in zip(list_hard_cases(quick, is_thorough=False), range(6), strict=False)
    ]
    second = [
        case for case, _ in zip(list_hard_cases(quick, is_thorough=False), range(6), strict=False)
    ]

    assert first == second
