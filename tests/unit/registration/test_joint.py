from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.registration.config import FineConfig
from boltpose.registration.covariance import depth_bias_variance_mm2
from boltpose.registration.joint import (
    JointConfig,
    PoseEstimate,
    distance_sigmas,
    estimate_in_base,
    fuse_poses,
)
from boltpose.schema import HandEyeError, Registration

FINE = FineConfig()
CENTRE = np.array([10.0, -20.0, 30.0])
NOISE = np.diag([2e-4] * 3 + [0.02] * 3) ** 2


def look_at(eye: np.ndarray, target: np.ndarray) -> Transform:
    """`base_from_camera` of a camera whose axis goes through the target."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.3, 0.5, 0.8])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    return Transform.from_parts("base", "camera", rotation, eye)


TRUTH = Transform.from_parts(
    "base", "prior", Rotation.from_rotvec([0.4, -0.2, 1.0]).as_matrix(), (300.0, 100.0, 50.0)
)
MOTOR = TRUTH.apply(CENTRE)


def registration(base_from_camera: Transform, base_from_prior: Transform = TRUTH) -> Registration:
    camera_from_prior = base_from_camera.inverse() @ base_from_prior
    centre = camera_from_prior.apply(CENTRE)
    sight = centre / np.linalg.norm(centre)
    covariance = NOISE.copy()
    covariance[3:, 3:] += depth_bias_variance_mm2(centre, FINE) * np.outer(sight, sight)
    return Registration(
        camera_from_prior=camera_from_prior,
        converged=True,
        rms_mm=0.07,
        inlier_ratio=1.0,
        covariance=covariance,
        centre_mm=centre,
        runner_up_score=0.2,
        score=0.9,
    )


def estimate(
    eye: tuple[float, float, float],
    config: JointConfig | None = None,
    error: HandEyeError | None = None,
) -> PoseEstimate:
    camera = look_at(MOTOR + np.array(eye), MOTOR)
    return estimate_in_base(registration(camera), camera, error, FINE, config or JointConfig())


def depth_sigma(covariance: np.ndarray, eye: tuple[float, float, float]) -> float:
    sight = np.array(eye) / np.linalg.norm(eye)
    return float(np.sqrt(sight @ covariance[3:, 3:] @ sight))


def test_nothing_of_the_covariance_is_lost_on_the_way_to_base() -> None:
    eye = (100.0, 200.0, 600.0)
    found = estimate(eye)
    camera = look_at(MOTOR + np.array(eye), MOTOR)
    turn = np.kron(np.eye(2), camera.rotation)
    np.testing.assert_allclose(
        found.covariance, turn @ registration(camera).covariance @ turn.T, atol=1e-12
    )


def test_one_view_is_its_own_answer() -> None:
    alone = estimate((0.0, 0.0, 700.0))
    fused = fuse_poses([alone], CENTRE)
    assert fused.worst is None
    np.testing.assert_allclose(fused.base_from_prior.matrix, TRUTH.matrix, atol=1e-12)
    np.testing.assert_allclose(fused.covariance, alone.covariance, rtol=1e-6, atol=1e-12)


def test_a_view_from_the_side_knows_the_depth_and_one_from_the_same_place_does_not() -> None:
    front, beside = (0.0, 0.0, 700.0), (0.0, 700.0, 0.0)
    config = JointConfig(shared_depth=0.99)
    alone = estimate(front, config)
    twice = fuse_poses([alone, alone], CENTRE)
    both = fuse_poses([alone, estimate(beside, config)], CENTRE)
    before = depth_sigma(alone.covariance, front)
    assert depth_sigma(twice.covariance, front) > 0.98 * before
    assert depth_sigma(both.covariance, front) < 0.3 * before


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    depth=st.floats(0, 0.9),
    hand_eye=st.floats(0, 0.9),
)
def test_more_views_never_know_less(seed: int, depth: float, hand_eye: float) -> None:
    rng = np.random.default_rng(seed)
    config = JointConfig(shared_depth=depth, shared_hand_eye=hand_eye)
    error = HandEyeError(rotation_sigma_rad=3e-4, translation_sigma_mm=0.2)
    eyes = [tuple(700 * v / np.linalg.norm(v)) for v in rng.standard_normal((3, 3))]
    every = [estimate(eye, config, error) for eye in eyes]
    for count in (2, 3):
        more = fuse_poses(every[:count], CENTRE).covariance
        less = fuse_poses(every[: count - 1], CENTRE).covariance
        scale = 1.0 / np.sqrt(np.diag(less))
        gained = (less - more) * np.outer(scale, scale)
        assert np.linalg.eigvalsh(gained).min() > -1e-6
        assert np.linalg.eigvalsh(more * np.outer(scale, scale)).min() > 0


def test_the_hand_eye_error_moves_the_motor_by_its_lever() -> None:
    error = HandEyeError(rotation_sigma_rad=1e-3, translation_sigma_mm=0.5)
    eye = (0.0, 0.0, 700.0)
    added = estimate(eye, error=error).covariance - estimate(eye).covariance
    expected = np.diag([1e-6] * 3 + [0.7**2 + 0.25, 0.7**2 + 0.25, 0.25])
    np.testing.assert_allclose(np.diag(added), np.diag(expected), rtol=1e-6)
    # a camera turned a little points beside the motor: the turn and the shift hang together
    assert abs(added[0, 4]) == pytest.approx(1e-6 * 700, rel=1e-6)


def test_stated_errors_come_true() -> None:
    """Errors drawn as the model says are found with the covariance that the fusion states."""
    rng = np.random.default_rng(1)
    config = JointConfig(shared_depth=0.6, shared_hand_eye=0.3)
    error = HandEyeError(rotation_sigma_rad=2e-4, translation_sigma_mm=0.1)
    views = [
        estimate(eye, config, error)
        for eye in ((100.0, 0.0, 700.0), (-300.0, 200.0, 500.0), (0.0, 500.0, 400.0))
    ]
    squares = []
    for _ in range(600):
        shared = rng.standard_normal(views[0].shared.shape[1])
        drawn = []
        for view in views:
            own = np.linalg.cholesky(view.own_covariance) @ rng.standard_normal(6)
            motion = own + view.shared @ shared
            turn = Rotation.from_rotvec(motion[:3]).as_matrix() @ TRUTH.rotation
            place = MOTOR + motion[3:] - turn @ CENTRE
            drawn.append(
                PoseEstimate(
                    base_from_prior=Transform.from_parts("base", "prior", turn, place),
                    own_covariance=view.own_covariance,
                    shared=view.shared,
                )
            )
        fused = fuse_poses(drawn, CENTRE)
        turn = Rotation.from_matrix(fused.base_from_prior.rotation @ TRUTH.rotation.T).as_rotvec()
        off = np.concatenate([turn, fused.base_from_prior.apply(CENTRE) - MOTOR])
        squares.append(off @ np.linalg.solve(fused.covariance, off))
    # chi-square with 6 degrees of freedom: mean 6, standard error of the mean 0.14
    assert np.mean(squares) == pytest.approx(6.0, abs=0.5)


def test_the_frame_of_the_robot_does_not_matter() -> None:
    elsewhere = Transform.from_parts(
        "base", "base", Rotation.from_rotvec([1.0, 2.0, -0.5]).as_matrix(), (900.0, -50.0, 10.0)
    )
    turn = np.kron(np.eye(2), elsewhere.rotation)
    views = [estimate((0.0, 0.0, 700.0)), estimate((400.0, 0.0, 500.0))]
    moved = [
        PoseEstimate(
            base_from_prior=elsewhere @ view.base_from_prior,
            own_covariance=turn @ view.own_covariance @ turn.T,
            shared=turn @ view.shared,
        )
        for view in views
    ]
    here, there = fuse_poses(views, CENTRE), fuse_poses(moved, CENTRE)
    np.testing.assert_allclose(
        (elsewhere @ here.base_from_prior).matrix, there.base_from_prior.matrix, atol=1e-9
    )
    np.testing.assert_allclose(turn @ here.covariance @ turn.T, there.covariance, atol=1e-9)


def test_views_that_disagree_are_told_by_pair_and_by_how_much() -> None:
    one, two = estimate((0.0, 0.0, 700.0)), estimate((0.0, 500.0, 500.0))
    off = Transform.from_parts(
        "base", "prior", TRUTH.rotation, TRUTH.translation_mm + np.array([2.0, 0.0, 0.0])
    )
    wrong = PoseEstimate(base_from_prior=off, own_covariance=two.own_covariance, shared=two.shared)
    worst = fuse_poses([one, two, wrong], CENTRE).worst
    assert worst is not None
    assert worst.second == 2
    assert worst.shift_mm == pytest.approx(2.0)
    assert worst.turn_rad == pytest.approx(0.0, abs=1e-9)
    assert worst.distance_sigmas > 20
    assert distance_sigmas(one, wrong, CENTRE) == pytest.approx(distance_sigmas(wrong, one, CENTRE))
    assert distance_sigmas(one, two, CENTRE) == pytest.approx(0.0, abs=1e-6)


def test_poses_far_apart_are_still_averaged_in_the_middle() -> None:
    view = estimate((0.0, 0.0, 700.0))
    plain = np.eye(6) * 1e-4
    poses = [
        Transform.from_parts(
            "base",
            "prior",
            Rotation.from_rotvec([0, 0, angle]).as_matrix(),
            -Rotation.from_rotvec([0, 0, angle]).apply(CENTRE),
        )
        for angle in (-0.04, 0.04)
    ]
    fused = fuse_poses(
        [
            PoseEstimate(base_from_prior=pose, own_covariance=plain, shared=0 * view.shared)
            for pose in poses
        ],
        CENTRE,
    )
    assert rotation_angle_rad(fused.base_from_prior.rotation) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(fused.base_from_prior.apply(CENTRE), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("shared_depth", 1.0),
        ("shared_hand_eye", -0.1),
        ("max_distance_sigmas", 0.0),
        ("veto_factor", 0.9),
        ("veto_factor", float("nan")),
    ],
)
def test_settings_out_of_range_are_refused(field: str, value: float) -> None:
    with pytest.raises(ConfigError, match=field):
        JointConfig(**{field: value})
