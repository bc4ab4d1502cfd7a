"""Several views of one clamping, with true labels in place of the networks.

reman18 clamps anew for every view. For the pose of the motor that is the same as one clamping seen
by cameras that stand where they see the motor as they do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError, FrameError
from boltpose.geometry.transforms import Transform
from boltpose.locate import locate
from boltpose.locate_views import Shot, locate_views
from boltpose.registration.evidence import bolt_sigma_mm
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.results import dump_json
from boltpose.schema import Check, HandEyeError, LocateResult, Status, Visibility
from tests.support import reman18

MOTOR = "motor_011"
VIEWS = (1, 2)
BASE_FROM_PRIOR = Transform.from_parts("base", "prior", np.eye(3), (400.0, -200.0, 100.0))


class TrueLabels:
    """Knows all views."""

    def predict(self, points: np.ndarray) -> np.ndarray:
        for number in VIEWS:
            truth = reman18.view(MOTOR, number)[1]
            if not truth.tree.query(points[:1])[0].any():
                return truth.predict(points)
        raise AssertionError("asked about points of another scan")


def shot(number: int, off_mm: float = 0.0) -> Shot:
    base_from_camera = BASE_FROM_PRIOR @ reman18.true_pose(MOTOR, number).inverse()
    moved = base_from_camera.translation_mm + np.array([0.0, 0.0, off_mm])
    return Shot(
        scan=reman18.view(MOTOR, number)[0],
        base_from_camera=Transform.from_parts("base", "camera", base_from_camera.rotation, moved),
    )


@pytest.fixture(scope="module")
def prepared() -> PreparedPrior:
    return prepare_prior(reman18.true_prior(MOTOR))


@pytest.fixture(scope="module")
def alone(prepared: PreparedPrior) -> list[LocateResult]:
    return [locate_views([shot(number)], prepared, TrueLabels()) for number in VIEWS]


@pytest.fixture(scope="module")
def together(prepared: PreparedPrior) -> LocateResult:
    return locate_views([shot(number) for number in VIEWS], prepared, TrueLabels())


def off_mm(result: LocateResult) -> float:
    tops = np.array([bolt.prior_from_bolt.translation_mm for bolt in prior_bolts()])
    assert result.registration is not None
    assert result.base_from_camera is not None
    found = result.base_from_camera @ result.registration.camera_from_prior
    return float(np.linalg.norm(found.apply(tops) - BASE_FROM_PRIOR.apply(tops), axis=1).max())


def prior_bolts():
    return reman18.true_prior(MOTOR).bolts


def test_one_view_is_locate_bit_by_bit(alone, prepared) -> None:
    view = shot(VIEWS[0])
    result = locate(view.scan, prepared, view.base_from_camera, TrueLabels())
    assert dump_json(alone[0]) == dump_json(result)


def test_two_views_are_right_and_know_it_better_than_one(alone, together, prepared) -> None:
    assert together.verdict.status is Status.OK
    assert together.frame == "base"
    assert off_mm(together) < 0.15
    assert together.registration is not None
    sigmas = [bolt_sigma_mm(one.registration, prepared) for one in alone]
    assert bolt_sigma_mm(together.registration, prepared) < min(sigmas)
    assert {bolt.frame_from_bolt.target for bolt in together.bolts} == {"base"}


def test_a_bolt_is_as_visible_as_in_the_view_that_sees_it_best(alone, together) -> None:
    for row, bolt in enumerate(together.bolts):
        best = max(one.bolts[row].visible_fraction for one in alone)
        assert bolt.visible_fraction == pytest.approx(best, abs=0.02)
    hidden = [
        sum(bolt.visibility is Visibility.HIDDEN for bolt in one.bolts)
        for one in [together, *alone]
    ]
    assert hidden[0] <= min(hidden[1:])


def test_the_order_of_the_views_does_not_matter(together, prepared) -> None:
    backwards = locate_views([shot(number) for number in VIEWS[::-1]], prepared, TrueLabels())
    assert dump_json(backwards) == dump_json(together)


@pytest.mark.parametrize("error_mm", [2.0, 6.0, 20.0])
def test_a_motor_in_two_places_is_refused(prepared, error_mm: float) -> None:
    result = locate_views([shot(VIEWS[0]), shot(VIEWS[1], error_mm)], prepared, TrueLabels())
    assert result.verdict.status is Status.REFUSED
    assert result.verdict.failed[0] is Check.VIEWS_DISAGREE
    assert result.verdict.p_correct == 0.0
    assert not result.bolts


def test_a_hand_eye_that_is_known_badly_forgives_more_and_promises_less(together, prepared) -> None:
    error = HandEyeError(rotation_sigma_rad=0.0, translation_sigma_mm=2.0)
    shots = [shot(VIEWS[0]), shot(VIEWS[1], 2.0)]
    result = locate_views(
        [replace(one, hand_eye_error=error) for one in shots], prepared, TrueLabels()
    )
    # the points hold the pose as well as ever, so it is given: with the sigma it has in `base`
    assert result.verdict.status is Status.OK
    assert result.verdict.scores["bolt_sigma_mm"] == pytest.approx(
        together.verdict.scores["bolt_sigma_mm"], rel=0.05
    )
    assert bolt_sigma_mm(result.registration, prepared) > 10 * bolt_sigma_mm(
        together.registration, prepared
    )
    assert min(bolt.sigma_lateral_mm for bolt in result.bolts) > 1.0


def test_what_cannot_be_asked_is_an_error(prepared) -> None:
    with pytest.raises(ConfigError, match="at least one scan"):
        locate_views([], prepared, TrueLabels())
    with pytest.raises(ConfigError, match="different scans"):
        locate_views([shot(1), shot(1, 1.0)], prepared, TrueLabels())
    wrong = replace(shot(2), base_from_camera=Transform.identity("camera", "base"))
    with pytest.raises(FrameError, match="base_from_camera"):
        locate_views([shot(1), wrong], prepared, TrueLabels())
