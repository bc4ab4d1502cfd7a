"""Fine registration: scan to prior, point-to-plane, with a covariance that does not flatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import FineConfig, FineStep
from boltpose.registration.covariance import LEVER_MM, pose_covariance
from boltpose.registration.prepare import PreparedPrior

_REPAIR_SHIFT_MM = 0.05
"""A step that moved no point by more than this keeps the pairs of the step before: with planes as
targets a partner two hundredths of a spacing off is the same partner."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FineResult:
    """A refined pose and how well it is determined."""

    camera_from_prior: Transform
    converged: bool
    iterations: int
    rms_mm: float
    """Of the last inlier residuals, kernel-weighted."""
    inlier_ratio: float
    """Share of the last resolution's scan points with weight."""
    covariance: FloatArray
    """Shape (6, 6): rotation vector (rad), translation (mm), frame `camera`, about `centre_mm`."""
    centre_mm: FloatArray
    """Shape (3,), frame `camera`: middle of the motor."""


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    rows: IntArray
    """Of the scan points that found a partner."""
    partners: IntArray
    """Their rows in the prior."""


def refine_pose(
    camera_from_prior: Transform,
    points_camera: FloatArray,
    prepared: PreparedPrior,
    config: FineConfig,
) -> FineResult:
    """Refine a pose that is right to a few millimetres.

    Args:
        camera_from_prior: The pose to start from.
        points_camera: Shape (N, 3), mm, frame `camera`: motor points.
        prepared: The prior.
        config: Settings.

    Returns:
        The refined pose. `converged` is False if the last resolution used up its iterations.

    Raises:
        DegenerateGeometryError: No scan point lies near the prior.

    Source:
        Chen and Medioni, Image and Vision Computing 10(3), 1992; Tukey's biweight as in
        Babin et al., ICRA 2019. Thinning, distances and kernels: FINDINGS section 1.
    """
    start = camera_from_prior.inverse()
    rotation, translation = start.rotation.copy(), start.translation_mm.copy()
    centre = prepared.centre_mm
    step = config.steps[-1]
    cloud, pairs = points_camera, None
    converged = False
    total = 0
    for step in config.steps:
        cloud = voxel_downsample(points_camera, step.voxel_mm)
        pairs = None
        converged = False
        for iteration in range(step.iterations):
            total += 1
            moved = cloud @ rotation.T + translation
            if pairs is None:
                pairs = _find_pairs(moved, cloud, rotation, prepared, step.max_distance_mm)
            jacobian, residuals, weights = _linearise(moved, pairs, centre, prepared, step)
            motion = _solve(jacobian, residuals, weights)
            turn = Rotation.from_rotvec(motion[:3] / LEVER_MM).as_matrix()
            rotation = turn @ rotation
            translation = turn @ (translation - centre) + centre + motion[3:]
            shift = _largest_shift(motion, prepared)
            if shift < config.converged_shift_mm:
                converged = True
                break
            # pairs that keep changing can run in a circle: the last third keeps them
            if shift > _REPAIR_SHIFT_MM and 3 * iteration < 2 * step.iterations:
                pairs = None
    refined = Transform.from_parts("prior", "camera", rotation, translation).inverse()
    # the pairs of a last step that hardly moved anything still hold
    return _assess(
        refined, cloud, pairs, prepared, config, step, converged=converged, iterations=total
    )


def assess_pose(
    camera_from_prior: Transform,
    points_camera: FloatArray,
    prepared: PreparedPrior,
    config: FineConfig,
    *,
    converged: bool,
    iterations: int,
) -> FineResult:
    """Measure residuals and covariance of a pose, at the last resolution, without moving it.

    Args:
        camera_from_prior: The pose.
        points_camera: Shape (N, 3), mm, frame `camera`: motor points.
        prepared: The prior.
        config: Settings.
        converged: What the refinement that led here says of itself.
        iterations: How many steps it took.

    Returns:
        The pose with its quality.

    Raises:
        DegenerateGeometryError: No scan point lies near the prior.
    """
    step = config.steps[-1]
    cloud = voxel_downsample(points_camera, step.voxel_mm)
    return _assess(
        camera_from_prior,
        cloud,
        None,
        prepared,
        config,
        step,
        converged=converged,
        iterations=iterations,
    )


def _assess(
    camera_from_prior: Transform,
    cloud: FloatArray,
    pairs: _Pairs | None,
    prepared: PreparedPrior,
    config: FineConfig,
    step: FineStep,
    *,
    converged: bool,
    iterations: int,
) -> FineResult:
    inverse = camera_from_prior.inverse()
    moved = inverse.apply(cloud)
    if pairs is None:
        pairs = _find_pairs(moved, cloud, inverse.rotation, prepared, step.max_distance_mm)
    centre = prepared.centre_mm
    jacobian, residuals, weights = _linearise(moved, pairs, centre, prepared, step)
    if not weights.any():
        raise DegenerateGeometryError(
            f"no motor point lies within {step.kernel_mm} mm of the posed prior's planes"
        )
    centre_camera = camera_from_prior.apply(centre)
    rms = float(np.sqrt(np.sum(weights * residuals**2) / np.sum(weights)))
    return FineResult(
        camera_from_prior=camera_from_prior,
        converged=converged,
        iterations=iterations,
        rms_mm=rms,
        inlier_ratio=float((weights > 0).sum() / len(cloud)),
        covariance=pose_covariance(
            jacobian, weights, rms, camera_from_prior.rotation, centre_camera, step.voxel_mm, config
        ),
        centre_mm=centre_camera,
    )


def _find_pairs(
    moved: FloatArray,
    cloud: FloatArray,
    rotation: FloatArray,
    prepared: PreparedPrior,
    max_distance_mm: float,
) -> _Pairs:
    distance, partner = prepared.tree.query(moved, distance_upper_bound=max_distance_mm, workers=-1)
    rows = np.flatnonzero(np.isfinite(distance))
    partners = np.asarray(partner[rows], dtype=np.int64)
    # a surface the camera measured faces it, and the cable may lie elsewhere by now
    away = np.einsum("ni,ni->n", cloud[rows] @ rotation.T, prepared.normals[partners])
    usable: BoolArray = (away < 0) & prepared.is_rigid[partners]
    if int(usable.sum()) < 6:
        raise DegenerateGeometryError(
            f"{int(usable.sum())} of {len(cloud)} scan points lie within {max_distance_mm} mm "
            "of the posed prior, wanted at least 6"
        )
    return _Pairs(rows[usable], partners[usable])


def _linearise(
    moved: FloatArray, pairs: _Pairs, centre: FloatArray, prepared: PreparedPrior, step: FineStep
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Jacobian (P, 6), residuals (P,) and Tukey weights (P,) in frame `prior`."""
    points = moved[pairs.rows]
    normals = prepared.normals[pairs.partners]
    residuals = np.einsum("ni,ni->n", prepared.points[pairs.partners] - points, normals)
    jacobian = np.hstack([np.cross((points - centre) / LEVER_MM, normals), normals])
    weights = np.square(np.maximum(1.0 - np.square(residuals / step.kernel_mm), 0.0))
    return jacobian, residuals, weights


def _solve(jacobian: FloatArray, residuals: FloatArray, weights: FloatArray) -> FloatArray:
    weighted = jacobian * weights[:, None]
    matrix = weighted.T @ jacobian
    matrix += np.eye(6) * (1e-6 * np.trace(matrix) + 1e-9)
    return np.linalg.solve(matrix, weighted.T @ residuals)


def _largest_shift(motion: FloatArray, prepared: PreparedPrior) -> float:
    turn = float(np.linalg.norm(motion[:3])) / LEVER_MM
    return turn * prepared.radius_mm + float(np.linalg.norm(motion[3:]))
