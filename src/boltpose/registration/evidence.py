"""Numbers that tell a right pose of the right motor from anything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray
from boltpose.geometry.sampling import voxel_downsample
from boltpose.registration.config import EvidenceConfig
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.scene import (
    Scene,
    Standing,
    free_space_violation,
    judge_surface,
    measured_share,
)
from boltpose.schema import Registration


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What the scan says about one pose; shares are 0 to 1."""

    motor_points: int
    """Motor points on 2 mm voxels."""
    free_space_violation: float
    """Share of the judged surface that the camera saw through."""
    explained: float
    """Share of the motor points on the posed prior's camera-facing surface."""
    tight: float
    """Share of the motor points near the prior that lie on it within the measuring error."""
    coverage: float
    """Share of the surface in free view on which scan points lie."""
    judged_points: int
    """Coarse prior points in free view with a measurement."""
    measured: float
    """Share of the surface in free view in whose direction anything was measured."""
    margin: float
    """Score ahead of the best clearly different pose."""
    bolt_sigma_mm: float
    """Largest 1 sigma of any bolt's position in any direction, from the pose alone."""
    converged: bool


def gather_evidence(
    registration: Registration,
    prepared: PreparedPrior,
    scene: Scene,
    motor_points: FloatArray,
    config: EvidenceConfig,
) -> Evidence:
    """Measure a pose against the scan; nothing is decided here.

    Args:
        registration: The pose.
        prepared: The prior.
        scene: The whole scan.
        motor_points: Shape (N, 3), mm, frame `camera`: what was taken for the motor.
        config: Settings.

    Returns:
        The numbers.
    """
    pose = registration.camera_from_prior
    standing = judge_surface(scene, pose, prepared, tolerance_mm=config.free_space_mm)
    explained, tight = _fit_of_points(registration, prepared, motor_points, config)
    judged = (standing == Standing.CONFIRMED) | (standing == Standing.VIOLATING)
    return Evidence(
        motor_points=len(voxel_downsample(motor_points, 2.0)) if len(motor_points) else 0,
        free_space_violation=free_space_violation(standing),
        explained=explained,
        tight=tight,
        coverage=_coverage(registration, prepared, scene, judged, config),
        judged_points=int(judged.sum()),
        measured=measured_share(standing),
        margin=registration.score - registration.runner_up_score,
        bolt_sigma_mm=bolt_sigma_mm(registration, prepared),
        converged=registration.converged,
    )


def bolt_sigma_mm(registration: Registration, prepared: PreparedPrior) -> float:
    """Largest 1 sigma, mm, of any bolt's position in any direction; without bolts of the centre."""
    positions = [bolt.prior_from_bolt.translation_mm for bolt in prepared.prior.bolts]
    levers = np.array(positions or [prepared.centre_mm])
    levers = registration.camera_from_prior.apply(levers) - registration.centre_mm
    largest = 0.0
    for x, y, z in levers:
        # d(w x lever) / dw
        jacobian = np.array([[0, z, -y, 1, 0, 0], [-z, 0, x, 0, 1, 0], [y, -x, 0, 0, 0, 1]])
        covariance = jacobian @ registration.covariance @ jacobian.T
        largest = max(largest, float(np.linalg.eigvalsh(covariance)[-1]))
    return float(np.sqrt(largest))


def _fit_of_points(
    registration: Registration,
    prepared: PreparedPrior,
    motor_points: FloatArray,
    config: EvidenceConfig,
) -> tuple[float, float]:
    if not len(motor_points):
        return 0.0, 0.0
    sample = motor_points[:: max(1, len(motor_points) // config.sample_points)]
    points = registration.camera_from_prior.inverse().apply(sample)
    camera = registration.camera_from_prior.inverse().translation_mm
    distance, partner = prepared.tree.query(
        points, distance_upper_bound=config.explained_mm, workers=-1
    )
    near = np.isfinite(distance)
    partner = partner[near]
    normals = prepared.normals[partner]
    facing = np.einsum("ni,ni->n", camera - points[near], normals) > 0
    residual = np.einsum("ni,ni->n", prepared.points[partner] - points[near], normals)
    judged = facing & prepared.is_rigid[partner]
    tight = np.abs(residual[judged]) < config.tight_mm
    return float(facing.sum() / len(points)), float(tight.sum() / max(len(tight), 1))


def _coverage(
    registration: Registration,
    prepared: PreparedPrior,
    scene: Scene,
    judged: BoolArray,
    config: EvidenceConfig,
) -> float:
    surface = prepared.coarse_points[judged].astype(np.float64)
    if not len(surface):
        return 0.0
    inverse = registration.camera_from_prior.inverse()
    points = inverse.apply(scene.points)
    near = np.linalg.norm(points - prepared.centre_mm, axis=1) < prepared.radius_mm + 3.0
    points = points[near]
    offset = points - prepared.coarse_points[prepared.grid.nearest(points)]
    points = points[np.einsum("ni,ni->n", offset, offset) < 25.0]
    if not len(points):
        return 0.0
    tree = KDTree(points)
    reach = config.coverage_mm
    if len(points) > 1:
        # a coarser scan cannot have a point as near everywhere
        spacing, _ = tree.query(points[:: max(1, len(points) // 500)], k=2)
        reach = max(reach, 2.0 * float(np.median(spacing[:, 1])))
    distance, _ = tree.query(surface, distance_upper_bound=reach, workers=-1)
    return float(np.isfinite(distance).mean())
