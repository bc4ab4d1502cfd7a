"""The main job on simulated motors (reman18), with true labels in place of the networks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform, angle_between_rad
from boltpose.locate import locate
from boltpose.registration.prepare import prepare_prior
from boltpose.results import dump_json
from boltpose.schema import LocateResult, Prior, Scan, Status
from tests.support import reman18

MOTOR, VIEW = "motor_011", 1


@pytest.fixture(scope="module")
def result() -> LocateResult:
    scan, predictor = reman18.view(MOTOR, VIEW)
    return locate(scan, reman18.true_prior(MOTOR), None, predictor)


def test_every_bolt_is_found_where_it_truly_is(result: LocateResult) -> None:
    assert result.verdict.status is Status.OK
    assert result.frame == "camera"
    truth = reman18.true_bolts(MOTOR, VIEW)
    assert len(result.bolts) == len(truth)
    assert len({bolt.id for bolt in result.bolts}) == len(truth)
    heads = np.array([bolt["B"]["head_top"] for bolt in truth])
    partners = set()
    for bolt in result.bolts:
        partner = int(np.linalg.norm(heads - bolt.head_top, axis=1).argmin())
        partners.add(partner)
        true = truth[partner]
        axis = np.array(true["B"]["axis"])
        offset = bolt.head_top - heads[partner]
        assert np.linalg.norm(offset - axis * (axis @ offset)) < 0.5
        assert abs(axis @ offset) < 0.5
        assert np.degrees(angle_between_rad(bolt.axis, axis)) < 0.6
        assert str(bolt.side) == true["side"]
        assert abs(bolt.visible_fraction - true["visible_fraction"]) < 0.3
    assert len(partners) == len(truth)


def test_the_same_input_gives_the_same_bytes_on_any_number_of_threads(
    result: LocateResult,
) -> None:
    scan, predictor = reman18.view(MOTOR, VIEW)
    with threadpool_limits(2):
        again = locate(scan, reman18.true_prior(MOTOR), None, predictor)
    with threadpool_limits(1):
        once_more = locate(scan, prepare_prior(reman18.true_prior(MOTOR)), None, predictor)
    assert dump_json(result) == dump_json(again) == dump_json(once_more)


def test_the_order_of_the_points_does_not_matter(result: LocateResult) -> None:
    scan, predictor = reman18.view(MOTOR, VIEW)
    order = np.random.default_rng(0).permutation(len(scan))
    for rows in (order, np.arange(len(scan))[::-1]):
        again = locate(scan.subset(rows), reman18.true_prior(MOTOR), None, predictor)
        assert dump_json(again) == dump_json(result)


def test_a_hand_eye_only_moves_the_result(result: LocateResult) -> None:
    base_from_camera = Transform.from_parts(
        "base",
        "camera",
        Rotation.from_euler("xyz", [170, 5, 30], degrees=True).as_matrix(),
        (400.0, -200.0, 900.0),
    )
    scan, predictor = reman18.view(MOTOR, VIEW)
    in_base = locate(scan, reman18.true_prior(MOTOR), base_from_camera, predictor)
    assert in_base.frame == "base"
    for moved, bolt in zip(in_base.bolts, result.bolts, strict=True):
        expected = base_from_camera @ bolt.frame_from_bolt
        np.testing.assert_allclose(moved.frame_from_bolt.matrix, expected.matrix, atol=1e-9)
        assert moved.sigma_lateral_mm == bolt.sigma_lateral_mm


def test_the_frame_of_the_prior_does_not_matter(result: LocateResult) -> None:
    prior = reman18.true_prior(MOTOR)
    moved_from_prior = Transform.from_parts(
        "prior", "prior", Rotation.from_rotvec([0.9, -1.3, 2.0]).as_matrix(), (300.0, 50.0, -80.0)
    )
    alignment = replace(
        prior.alignment,
        prior_from_motor=moved_from_prior @ prior.alignment.prior_from_motor,
    )
    moved = replace(
        prior,
        points=moved_from_prior.apply(prior.points),
        normals=moved_from_prior.rotate(prior.normals),
        alignment=alignment,
        bolts=tuple(
            replace(bolt, prior_from_bolt=moved_from_prior @ bolt.prior_from_bolt)
            for bolt in prior.bolts
        ),
    )
    scan, predictor = reman18.view(MOTOR, VIEW)
    again = locate(scan, moved, None, predictor)
    assert again.verdict.status is Status.OK
    for bolt, same in zip(result.bolts, again.bolts, strict=True):
        assert np.linalg.norm(bolt.head_top - same.head_top) < 0.1


def _refused(scan: Scan, prior: Prior, probability: np.ndarray) -> LocateResult:
    found = locate(scan, prior, None, reman18.TruePredictor(scan.points, probability))
    assert found.verdict.status is Status.REFUSED
    assert found.bolts == ()
    assert len(found.verdict.reasons) >= 1
    return found


@pytest.mark.parametrize("other", ["motor_005", "motor_017", "motor_000"])
def test_another_motor_is_refused(other: str) -> None:
    """The first two are of the same family in another size."""
    scan, predictor = reman18.view(MOTOR, VIEW)
    _refused(scan, reman18.true_prior(other), predictor.motor_probability)


def test_a_mirrored_scan_is_refused() -> None:
    scan, predictor = reman18.view(MOTOR, VIEW)
    mirrored = Scan(points=scan.points * (-1.0, 1.0, 1.0))
    _refused(mirrored, reman18.true_prior(MOTOR), predictor.motor_probability)


def test_noise_and_an_empty_clamp_are_refused() -> None:
    prior = reman18.true_prior(MOTOR)
    rng = np.random.default_rng(0)
    noise = Scan(points=rng.uniform((-150, -150, 600), (150, 150, 900), (50_000, 3)))
    _refused(noise, prior, np.ones(50_000))

    scan, predictor = reman18.view(MOTOR, VIEW)
    clamp = scan.subset(predictor.motor_probability < 0.5)
    _refused(clamp, prior, np.ones(len(clamp)))


def test_a_scan_without_motor_points_is_refused_with_the_number() -> None:
    scan, _ = reman18.view(MOTOR, VIEW)
    found = _refused(scan, reman18.true_prior(MOTOR), np.zeros(len(scan)))
    assert found.registration is None


def test_an_inverted_hand_eye_is_an_error() -> None:
    scan, predictor = reman18.view(MOTOR, VIEW)
    with pytest.raises(FrameError, match="hand-eye must be base_from_camera, got camera_from_base"):
        locate(scan, reman18.true_prior(MOTOR), Transform.identity("camera", "base"), predictor)
