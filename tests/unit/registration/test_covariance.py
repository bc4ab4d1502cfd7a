"""The laws of the stated covariance of a pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.registration.config import FineConfig
from boltpose.registration.covariance import LEVER_MM, depth_bias_variance_mm2, pose_covariance

CENTRE = np.array([60.0, -40.0, 700.0])
CONFIG = FineConfig()
BLIND = replace(
    CONFIG,
    lateral_sigma_mm=1e-9,
    rotation_sigma_rad=1e-12,
    depth_scale_sigma=1e-12,
    depth_ripple_mm=1e-9,
)
"""A camera without any error but that of its points."""


def ball(count: int = 4000, radius_mm: float = LEVER_MM) -> np.ndarray:
    """Rows of a jacobian: points of a bumpy ball that holds all six degrees of freedom."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(count, 3))
    points *= radius_mm / np.linalg.norm(points, axis=1)[:, None]
    normals = points / radius_mm + rng.normal(scale=0.5, size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return np.hstack([np.cross(points, normals) / LEVER_MM, normals])


def covariance(
    jacobian: np.ndarray,
    config: FineConfig = CONFIG,
    *,
    rms_mm: float = 0.1,
    rotation: np.ndarray | None = None,
    weights: np.ndarray | None = None,
) -> np.ndarray:
    return pose_covariance(
        jacobian,
        np.ones(len(jacobian)) if weights is None else weights,
        rms_mm,
        np.eye(3) if rotation is None else rotation,
        CENTRE,
        1.0,
        config,
    )


def test_it_is_a_covariance() -> None:
    found = covariance(ball())
    np.testing.assert_array_equal(found, found.T)
    assert np.linalg.eigvalsh(found).min() > 0


def test_it_states_the_scatter_of_refined_poses() -> None:
    """Monte Carlo: noise of the residuals, solved as the refinement solves, scatters as stated."""
    jacobian, noise_mm, config = ball(800), 0.2, replace(BLIND, correlation_length_mm=1.0)
    rng = np.random.default_rng(1)
    noise = rng.normal(scale=noise_mm, size=(len(jacobian), 4000))
    motions = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    motions[:3] /= LEVER_MM
    stated = covariance(jacobian, config, rms_mm=noise_mm)
    ratio = np.diag(np.cov(motions)) / np.diag(stated)
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)


def test_neighbours_that_err_together_count_as_one() -> None:
    alone = covariance(ball(), replace(BLIND, correlation_length_mm=1.0))
    together = covariance(ball(), replace(BLIND, correlation_length_mm=3.0))
    np.testing.assert_allclose(together, 9.0 * alone, rtol=1e-3)


def test_weights_are_points() -> None:
    jacobian = ball()
    doubled = covariance(np.vstack([jacobian, jacobian]), BLIND)
    weighted = covariance(jacobian, BLIND, weights=np.full(len(jacobian), 2.0))
    np.testing.assert_allclose(weighted, doubled, rtol=1e-9)


def test_more_points_never_lower_it_below_what_the_camera_adds_to_all_alike() -> None:
    huge = covariance(ball(), rms_mm=0.02, weights=np.full(4000, 1e6))
    view = CENTRE / np.linalg.norm(CENTRE)
    assert view @ huge[3:, 3:] @ view >= depth_bias_variance_mm2(CENTRE, CONFIG)
    assert np.linalg.eigvalsh(huge[3:, 3:]).min() >= CONFIG.lateral_sigma_mm**2
    assert np.linalg.eigvalsh(huge[:3, :3]).min() >= CONFIG.rotation_sigma_rad**2


def test_the_bias_lies_along_the_line_of_sight_and_grows_with_distance() -> None:
    view = CENTRE / np.linalg.norm(CENTRE)
    more = covariance(ball()) - covariance(ball(), BLIND)
    values, vectors = np.linalg.eigh(more[3:, 3:])
    assert abs(vectors[:, -1] @ view) == pytest.approx(1.0, abs=1e-9)
    assert values[-1] == pytest.approx(
        CONFIG.lateral_sigma_mm**2 + depth_bias_variance_mm2(CENTRE, CONFIG)
    )
    assert depth_bias_variance_mm2(2 * CENTRE, CONFIG) > depth_bias_variance_mm2(CENTRE, CONFIG)


def test_a_direction_without_information_is_uncertain_and_the_others_are_not() -> None:
    """A cylinder along z may slide along it and turn about it, and nothing else."""
    rng = np.random.default_rng(2)
    angle, height = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(-60, 60, 4000)
    normals = np.stack([np.cos(angle), np.sin(angle), np.zeros(4000)], axis=1)
    points = 40.0 * normals + height[:, None] * np.array([0.0, 0.0, 1.0])
    found = covariance(np.hstack([np.cross(points, normals) / LEVER_MM, normals]))
    sigma = np.sqrt(np.diag(found))
    assert sigma[5] > 100.0
    assert sigma[2] > 1.0
    assert sigma[[3, 4]].max() < 0.5
    assert sigma[[0, 1]].max() < 0.01


def test_it_turns_with_the_pose() -> None:
    """What the prior's frame states is carried into the camera's."""
    rotation = Rotation.from_rotvec([0.3, -0.7, 0.4]).as_matrix()
    turn = np.kron(np.eye(2), rotation)
    straight = covariance(ball(), BLIND)
    np.testing.assert_allclose(
        covariance(ball(), BLIND, rotation=rotation),
        turn @ straight @ turn.T,
        rtol=1e-6,
        atol=1e-12,
    )


def test_noise_free_points_claim_no_certainty() -> None:
    np.testing.assert_array_equal(
        covariance(ball(), BLIND, rms_mm=0.0), covariance(ball(), BLIND, rms_mm=0.01)
    )
