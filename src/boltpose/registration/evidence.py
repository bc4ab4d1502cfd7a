"""Numbers that tell a right pose of the right motor from anything else."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
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

_LEVER_MM = 50.0
"""Turns count as millimetres at this distance, about half a starter motor."""
_ROUGH_REACH_MM = 5.0
"""Scan points this near to the coarse surface, by the grid's approximate answer, are looked at."""
_CELLS_PER_REACH = 2
"""Cells per coverage distance: what counts as near is right to a quarter of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What the scan says about one pose; shares are 0 to 1."""

    motor_points: int
    """Motor points on 2 mm voxels."""
    free_space_violation: float
    """Share of the judged surface that the camera saw through; not of the cable and the plug, which
    may lie elsewhere by now."""
    explained: float
    """Share of the motor points on the posed prior's camera-facing surface."""
    tight: float
    """Share of the motor points near the prior that lie on it within the measuring error."""
    weakest_tight: float
    """The same share, each point counted by how much it would feel the motion that is felt least
    well by all points together: of the six independent small motions the one with the lowest."""
    sunk: float
    """Share of all scan points within 3 mm of the surface that lie clearly inside the motor, where
    nothing can be measured."""
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


EVIDENCE_NAMES = tuple(field.name for field in fields(Evidence))


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
    standing = _without_moved_cable(standing, prepared)
    fit = _fit_of_points(pose, prepared, motor_points, config)
    near = _near_surface(pose, prepared, scene)
    judged = (standing == Standing.CONFIRMED) | (standing == Standing.VIOLATING)
    return Evidence(
        motor_points=len(voxel_downsample(motor_points, 2.0)) if len(motor_points) else 0,
        free_space_violation=free_space_violation(standing),
        explained=fit.explained,
        tight=fit.tight,
        weakest_tight=fit.weakest_tight,
        sunk=_sunk_share(near, pose, prepared, config),
        coverage=_coverage(near, prepared.coarse_points[judged].astype(np.float64), config),
        judged_points=int(judged.sum()),
        measured=measured_share(standing),
        margin=registration.score - registration.runner_up_score,
        bolt_sigma_mm=bolt_sigma_mm(registration, prepared),
        converged=registration.converged,
    )


def _without_moved_cable(standing: IntArray, prepared: PreparedPrior) -> IntArray:
    """Leave surface of the electrical connector that was seen through out of the judgement."""
    rows = np.flatnonzero(standing == Standing.VIOLATING)
    if not len(rows):
        return standing
    _, partner = prepared.tree.query(prepared.coarse_points[rows], workers=-1)
    kept = standing.copy()
    kept[rows[~prepared.is_rigid[partner]]] = Standing.NOT_FACING
    return kept


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    explained: float = 0.0
    tight: float = 0.0
    weakest_tight: float = 0.0


def _fit_of_points(
    pose: Transform, prepared: PreparedPrior, motor_points: FloatArray, config: EvidenceConfig
) -> _Fit:
    if not len(motor_points):
        return _Fit()
    sample = motor_points[:: max(1, len(motor_points) // config.sample_points)]
    prior_from_camera = pose.inverse()
    points = prior_from_camera.apply(sample)
    distance, partner = prepared.tree.query(
        points, distance_upper_bound=config.explained_mm, workers=-1
    )
    near = np.isfinite(distance)
    partner = partner[near]
    points = points[near]
    normals = prepared.normals[partner]
    facing = np.einsum("ni,ni->n", prior_from_camera.translation_mm - points, normals) > 0
    judged = facing & prepared.is_rigid[partner]
    if not judged.any():
        return _Fit(explained=float(facing.sum() / len(sample)))
    residual = np.einsum("ni,ni->n", prepared.points[partner] - points, normals)
    is_tight = (np.abs(residual) < config.tight_mm)[judged]
    sensitivity = _jacobian(points[judged], normals[judged], prepared.centre_mm)
    directions = np.linalg.eigh(sensitivity.T @ sensitivity)[1]
    felt = np.square(sensitivity @ directions)
    return _Fit(
        explained=float(facing.sum() / len(sample)),
        tight=float(is_tight.mean()),
        weakest_tight=float((is_tight @ felt / np.maximum(felt.sum(axis=0), 1e-12)).min()),
    )


def _jacobian(points: FloatArray, normals: FloatArray, centre: FloatArray) -> FloatArray:
    """How far, (N, 6), every point's plane residual moves under six small motions of 1 mm."""
    return np.hstack([np.cross((points - centre) / _LEVER_MM, normals), normals])


def _near_surface(pose: Transform, prepared: PreparedPrior, scene: Scene) -> FloatArray:
    """Scan points roughly within 5 mm of the posed surface, shape (K, 3), frame `prior`."""
    middle = pose.apply(prepared.centre_mm)
    reach = prepared.radius_mm + 3.0
    in_box = np.abs(scene.points[:, 0] - middle[0]) < reach
    for axis in (1, 2):  # column by column: a third of the time of all three at once
        in_box &= np.abs(scene.points[:, axis] - middle[axis]) < reach
    points = pose.inverse().apply(scene.points[in_box])
    offset = points - prepared.coarse_points[prepared.grid.nearest(points)]
    return points[np.einsum("ni,ni->n", offset, offset) < _ROUGH_REACH_MM**2]


def _sunk_share(
    near: FloatArray, pose: Transform, prepared: PreparedPrior, config: EvidenceConfig
) -> float:
    if not len(near):
        return 1.0
    points = near[:: max(1, len(near) // config.sample_points)]
    distance, partner = prepared.tree.query(
        points, distance_upper_bound=config.sunk_reach_mm, workers=-1
    )
    found = np.isfinite(distance)
    points, partner = points[found], partner[found]
    normals = prepared.normals[partner]
    camera = pose.inverse().translation_mm
    facing = np.einsum("ni,ni->n", camera - points, normals) > 0
    judged = facing & prepared.is_rigid[partner]
    height = np.einsum("ni,ni->n", points - prepared.points[partner], normals)[judged]
    return float((height < -config.sunk_mm).sum() / max(len(height), 1))


def _coverage(near: FloatArray, surface: FloatArray, config: EvidenceConfig) -> float:
    if not len(surface) or not len(near):
        return 0.0
    reach = config.coverage_mm
    if len(near) > 1:
        # a coarser scan cannot have a point as near everywhere
        tree = KDTree(near, balanced_tree=False, compact_nodes=False)  # 500 queries: built fast
        spacing, _ = tree.query(near[:: max(1, len(near) // 500)], k=2)
        reach = max(reach, 2.0 * float(np.median(spacing[:, 1])))
    return float(_is_near_any(surface, near, reach).mean())


def _is_near_any(surface: FloatArray, points: FloatArray, reach_mm: float) -> BoolArray:
    """Whether each surface point has a scan point within about `reach_mm`, by occupied cells."""
    cell = reach_mm / _CELLS_PER_REACH
    low = surface.min(axis=0) - 2 * reach_mm
    shape = np.ceil((surface.max(axis=0) + 2 * reach_mm - low) / cell).astype(np.int64)
    rows = np.floor((points - low) / cell).astype(np.int64)
    rows = rows[((rows >= 0) & (rows < shape)).all(axis=1)]
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    occupied = np.zeros(int(shape.prod()), dtype=np.bool_)
    occupied[rows @ strides] = True
    centre = np.floor((surface - low) / cell).astype(np.int64) @ strides
    steps = np.stack(
        np.meshgrid(*[np.arange(-_CELLS_PER_REACH, _CELLS_PER_REACH + 1)] * 3, indexing="ij"), -1
    ).reshape(-1, 3)
    steps = steps[(steps**2).sum(axis=1) <= _CELLS_PER_REACH**2]
    found = np.zeros(len(surface), dtype=np.bool_)
    for step in steps @ strides:
        found |= occupied[centre + step]
    return found
