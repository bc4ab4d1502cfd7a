from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.geometry.transforms import Transform
from boltpose.registration.config import VerifyConfig, VisibilityConfig
from boltpose.registration.prepare import prepare_prior
from boltpose.registration.register import register
from boltpose.registration.scene import build_scene
from boltpose.registration.verify import verify
from boltpose.registration.visibility import classify_visibility, head_surface, see_bolts
from boltpose.schema import Check, Part, Registration, Status, Visibility
from tests.unit.registration.scenes import (
    cylinder,
    motor_prior,
    pose,
    prepared_motor,
    view,
    visible_points,
)

TRUTH = pose(turn=(0.4, 1.9, 0.3))


@pytest.fixture(scope="module")
def scan() -> tuple[np.ndarray, np.ndarray]:
    return view(TRUTH)


@pytest.fixture(scope="module")
def best(scan: tuple[np.ndarray, np.ndarray]) -> Registration:
    points, is_motor = scan
    found = register(prepared_motor(), points[is_motor], scene=build_scene(points)).best
    assert found is not None
    return found


def test_a_right_pose_is_accepted_with_every_score_beside_its_threshold(scan, best) -> None:
    points, is_motor = scan

    verdict = verify(best, prepared_motor(), build_scene(points), points[is_motor])

    assert verdict.status is Status.OK
    assert verdict.failed == ()
    assert verdict.reasons == ()
    assert set(verdict.scores) > set(verdict.thresholds)
    assert verdict.p_correct > 0.5


@pytest.mark.parametrize(
    ("turn", "shift"),
    [
        ((0, 0, 0), (2, 0, 0)),
        ((0, 0, 0), (0, 2, 0)),
        ((0, 0, 0), (0, 0, 3)),
        ((0.05, 0, 0), (0, 0, 0)),
        ((0, 0, 0.06), (0, 0, 0)),
        ((0, 0, np.pi), (0, 0, 0)),
        ((np.pi, 0, 0), (0, 0, 0)),
    ],
)
def test_a_moved_pose_is_refused(scan, best, turn: tuple, shift: tuple) -> None:
    points, is_motor = scan
    rotation = Rotation.from_rotvec(turn).as_matrix()
    inner = Transform.from_parts("prior", "prior", rotation, shift)
    wrong = replace(best, camera_from_prior=best.camera_from_prior @ inner)

    verdict = verify(wrong, prepared_motor(), build_scene(points), points[is_motor])

    assert verdict.status is Status.REFUSED
    assert len(verdict.reasons) >= len(verdict.failed) >= 1
    assert all("wanted" in reason for reason in verdict.reasons)


@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_another_size_of_the_motor_is_refused(scan, scale: float) -> None:
    points, is_motor = scan
    scene = build_scene(points)
    other = prepared_motor(scale)

    result = register(other, points[is_motor], scene=scene)
    verdict = verify(result.best, other, scene, points[is_motor])

    assert verdict.status is Status.REFUSED


def test_a_mirrored_scan_is_refused(scan) -> None:
    points, is_motor = scan
    mirrored = points * (-1.0, 1.0, 1.0)
    scene = build_scene(mirrored)

    result = register(prepared_motor(), mirrored[is_motor], scene=scene)
    verdict = verify(result.best, prepared_motor(), scene, mirrored[is_motor])

    assert verdict.status is Status.REFUSED


def test_noise_is_refused() -> None:
    noise = np.random.default_rng(0).uniform((-60, -60, 550), (60, 60, 650), (20_000, 3))
    scene = build_scene(noise)

    result = register(prepared_motor(), noise, scene=scene)
    verdict = verify(result.best, prepared_motor(), scene, noise)

    assert verdict.status is Status.REFUSED
    assert Check.FIT in verdict.failed


def test_a_small_patch_of_the_right_motor_is_not_enough(scan, best) -> None:
    points, is_motor = scan
    motor = points[is_motor]
    patch = motor[np.linalg.norm(motor - motor[0], axis=1) < 25.0]

    verdict = verify(best, prepared_motor(), build_scene(patch), patch)

    assert verdict.failed == (Check.COVERAGE,)
    assert verdict.scores["measured"] < 0.5


def test_a_body_that_looks_the_same_from_all_around_is_refused() -> None:
    points, normals = cylinder(30.0, (-50.0, 50.0), (0.0, 0.0), 1.0)
    labels = np.full(len(points), int(Part.MAIN_HOUSING), dtype=np.uint8)
    prepared = prepare_prior(replace(motor_prior(), points=points, normals=normals, labels=labels))
    seen = TRUTH.apply(points)
    facing = np.einsum("ni,ni->n", seen, TRUTH.rotate(normals)) < 0
    noise = np.random.default_rng(0).normal(scale=0.05, size=(int(facing.sum()), 3))
    scan = seen[facing] + noise
    scene = build_scene(scan)

    verdict = verify(register(prepared, scan, scene=scene).best, prepared, scene, scan)

    # everything lies where it should, and yet the roll is anyone's guess
    assert verdict.scores["tight"] > 0.95
    assert verdict.scores["coverage"] > 0.95
    assert Check.AMBIGUOUS in verdict.failed


@pytest.mark.parametrize(("count", "check"), [(0, Check.NO_MOTOR), (100, Check.TOO_FEW_POINTS)])
def test_no_pose_is_refused(scan, count: int, check: Check) -> None:
    points, _ = scan

    verdict = verify(None, prepared_motor(), build_scene(points), points[:count])

    assert verdict.status is Status.REFUSED
    assert verdict.failed == (check,)
    assert verdict.reasons == (f"no pose was found for {count} motor points",)


@pytest.mark.parametrize(
    ("change", "check"),
    [
        ({"converged": False}, Check.UNCONSTRAINED),
        ({"covariance": np.eye(6)}, Check.UNCONSTRAINED),
        ({"runner_up_score": 0.99}, Check.AMBIGUOUS),
    ],
)
def test_each_doubt_alone_refuses(scan, best, change: dict, check: Check) -> None:
    points, is_motor = scan
    doubtful = replace(best, **change)

    verdict = verify(doubtful, prepared_motor(), build_scene(points), points[is_motor])

    assert verdict.failed == (check,)
    assert len(verdict.reasons) == 1


def test_a_stricter_threshold_refuses_and_is_reported(scan, best) -> None:
    points, is_motor = scan
    strict = VerifyConfig(min_coverage=1.0)

    verdict = verify(best, prepared_motor(), build_scene(points), points[is_motor], strict)

    assert Check.COVERAGE in verdict.failed
    assert verdict.thresholds["coverage"] == 1.0


def test_bolts_facing_the_camera_are_seen_and_the_ones_behind_are_not() -> None:
    truth = pose(turn=(np.pi, 0.0, 0.0))  # +z of the motor looks at the camera
    scan = visible_points(truth, step=0.4)

    sights = {sight.bolt_id: sight for sight in see_bolts(prepared_motor(), truth, scan)}

    for name in ("T1", "T2"):
        assert sights[name].visibility is Visibility.VISIBLE
        # the face is r / (r + 2 h) of the head; of the flank the rim is within 0.7 mm of it
        assert 0.25 < sights[name].visible_fraction < 0.7
    assert sights["B1"].visibility is Visibility.HIDDEN
    assert sights["B1"].visible_fraction == 0.0
    assert sights["B1"].scan_points == 0


def test_the_head_is_what_is_labelled_a_bolt_around_the_axis() -> None:
    prepared = prepared_motor()
    for bolt in prepared.prior.bolts:
        local = bolt.prior_from_bolt.inverse().apply(head_surface(prepared, bolt))
        assert len(local) > 50
        assert np.hypot(local[:, 0], local[:, 1]).max() < 5.01
        assert local[:, 2].min() > -4.01
    assert (prepared.prior.labels == Part.BOLT).any()


@pytest.mark.parametrize(
    ("fraction", "count", "expected"),
    [
        (0.6, 500, Visibility.VISIBLE),
        (0.6, 29, Visibility.HIDDEN),
        (0.2, 500, Visibility.PARTIAL),
        (0.09, 500, Visibility.HIDDEN),
        (0.0, 0, Visibility.HIDDEN),
    ],
)
def test_visibility_names(fraction: float, count: int, expected: Visibility) -> None:
    assert classify_visibility(fraction, count, VisibilityConfig()) is expected


def test_a_right_pose_is_refused_where_more_certainty_is_wanted_than_there_is(scan, best) -> None:
    points, is_motor = scan
    config = VerifyConfig(min_p_correct=1.0)

    verdict = verify(best, prepared_motor(), build_scene(points), points[is_motor], config)

    assert verdict.failed == (Check.UNLIKELY,)
    assert verdict.reasons[0].startswith("probability that the pose is right")
    assert verdict.p_correct == verdict.scores["p_correct"] < 1.0


def test_without_a_pose_nothing_is_likely(scan) -> None:
    points, is_motor = scan

    verdict = verify(None, prepared_motor(), build_scene(points), points[is_motor])

    assert verdict.p_correct == 0.0
