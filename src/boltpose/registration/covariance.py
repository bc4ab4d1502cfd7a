"""How well a pose is known: the residuals' say, and what no residual shows."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.registration.config import FineConfig

LEVER_MM = 50.0
"""Rotations are solved for as millimetres at this distance, for a well-scaled 6 x 6 system."""


def pose_covariance(
    jacobian: FloatArray,
    weights: FloatArray,
    rms_mm: float,
    camera_from_prior_rotation: FloatArray,
    centre_camera: FloatArray,
    voxel_mm: float,
    config: FineConfig,
) -> FloatArray:
    """Formal covariance, for correlated residuals, plus what the camera adds to all points alike.

    Args:
        jacobian: Shape (P, 6): rotation at `LEVER_MM`, translation, frame `prior`.
        weights: Shape (P,).
        rms_mm: Of the residuals.
        camera_from_prior_rotation: Shape (3, 3).
        centre_camera: Shape (3,), mm, frame `camera`: the motor's centre.
        voxel_mm: Spacing of the points.
        config: Settings.

    Returns:
        Shape (6, 6), of a small motion in frame `camera` about the motor's centre: rotation vector
        (rad), translation (mm).
    """
    # the scan points move by (w, t) in frame prior; the prior moves by the opposite in frame
    # camera, which has the same covariance once both halves are turned
    scale = np.repeat([1.0 / LEVER_MM, 1.0], 3)
    together = max(1.0, (config.correlation_length_mm / voxel_mm) ** 2)
    # noise-free data would claim certainty; 0.01 mm is below any sensor's noise
    variance = max(rms_mm, 0.01) ** 2 * together
    information = (jacobian * weights[:, None]).T @ jacobian / variance
    # a direction without any information gets a sigma of 1000 mm at the lever, not infinity
    information += 1e-6 * np.eye(6)
    covariance = np.linalg.inv(information) * np.outer(scale, scale)
    turn = np.kron(np.eye(2), camera_from_prior_rotation)
    covariance = turn @ covariance @ turn.T
    view = centre_camera / np.linalg.norm(centre_camera)
    floor = np.zeros((6, 6))
    floor[:3, :3] = config.rotation_sigma_rad**2 * np.eye(3)
    floor[3:, 3:] = config.lateral_sigma_mm**2 * np.eye(3)
    floor[3:, 3:] += depth_bias_variance_mm2(centre_camera, config) * np.outer(view, view)
    result = covariance + floor
    return 0.5 * (result + result.T)


def depth_bias_variance_mm2(centre_camera: FloatArray, config: FineConfig) -> float:
    """Variance along the line of sight, mm2, of what moves all points alike and no residual shows.

    Args:
        centre_camera: Shape (3,), mm, frame `camera`.
        config: Settings.
    """
    distance = float(np.linalg.norm(centre_camera))
    return (config.depth_scale_sigma * distance) ** 2 + config.depth_ripple_mm**2
