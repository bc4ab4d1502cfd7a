"""Prior and motor points of one view -> ranked candidate poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, as_points
from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.sampling import canonical_rows, voxel_downsample
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.registration.batch import PoseBatch, score_batch, step_batch
from boltpose.registration.coarse import register_coarsely
from boltpose.registration.config import RegistrationConfig
from boltpose.registration.icp import FineResult, assess_pose, refine_pose
from boltpose.registration.paper import register_as_paper
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.scene import Scene, free_space_violation, judge_surface
from boltpose.schema import Registration


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RegistrationResult:
    """Every distinct pose worth a look, best first, or why there is none."""

    candidates: tuple[Registration, ...]
    """Refined, mutually different, best first; empty when registration was not possible."""
    message: str
    """One sentence on what happened."""
    motor_point_count: int
    """Motor points given, on 2 mm voxels."""
    used_offsets: bool
    """True if shifted start poses were needed."""

    @property
    def best(self) -> Registration | None:
        """The best candidate; None if there is none. Not a verdict: see `verify`."""
        return self.candidates[0] if self.candidates else None


def register(
    prepared: PreparedPrior,
    motor_points_camera: npt.ArrayLike,
    config: RegistrationConfig | None = None,
    *,
    scene: Scene | None = None,
) -> RegistrationResult:
    """Find the pose of a prior in a view, and the best clearly different ones.

    Args:
        prepared: The prior.
        motor_points_camera: Shape (N, 3), mm, frame `camera`: points taken for the motor; a fifth
            of them may belong to the clamp, a third of the motor may be missing.
        config: Settings.
        scene: The whole scan. If given, poses the camera saw through rank lower.

    Returns:
        The candidates. Nothing found is a result with a message, no exception; whether the best
        candidate may be used is for `verify` to say.

    Raises:
        ShapeError: `motor_points_camera` is not (N, 3) and finite.
        MissingExtraError: `config.method` needs Open3D and it is not installed.
    """
    config = config or RegistrationConfig()
    points = as_points(motor_points_camera, "motor_points_camera", at_least=0)
    if len(points) > config.max_points:
        points = points[canonical_rows(points, config.max_points)]
    thinned = voxel_downsample(points, 2.0) if len(points) else points
    if len(thinned) < config.min_points:
        return RegistrationResult(
            candidates=(),
            message=f"{len(thinned)} motor points on 2 mm voxels, wanted {config.min_points}",
            motor_point_count=len(thinned),
            used_offsets=False,
        )
    if config.method != "multi_start":
        return _register_as_paper(prepared, points, thinned, config, scene)
    coarse = register_coarsely(prepared, thinned, config.coarse)
    order = np.random.default_rng(config.coarse.seed).permutation(len(thinned))
    sample = thinned[order[: config.ranking_points]]
    candidates = _refine_candidates(prepared, points, sample, coarse.poses, config, scene)
    return RegistrationResult(
        candidates=candidates,
        message=f"{len(candidates)} candidates" if candidates else "no pose fits the motor points",
        motor_point_count=len(thinned),
        used_offsets=coarse.used_offsets,
    )


def _register_as_paper(
    prepared: PreparedPrior,
    points: FloatArray,
    thinned: FloatArray,
    config: RegistrationConfig,
    scene: Scene | None,
) -> RegistrationResult:
    pose = register_as_paper(
        prepared, points, config.paper, is_point_to_plane=config.method == "paper"
    )
    candidates: tuple[Registration, ...] = ()
    message = f"1 candidate by method {config.method}"
    try:
        fine = assess_pose(pose, points, prepared, config.fine, converged=True, iterations=0)
        order = np.random.default_rng(config.coarse.seed).permutation(len(thinned))
        sample = thinned[order[: config.ranking_points]]
        score = rank_pose(pose, sample, prepared, config, scene)
        candidates = _as_registrations([_Candidate(pose, score, fine)])
    except DegenerateGeometryError as error:
        message = f"method {config.method} found no pose: {error}"
    return RegistrationResult(
        candidates=candidates,
        message=message,
        motor_point_count=len(thinned),
        used_offsets=False,
    )


def rank_pose(
    camera_from_prior: Transform,
    sample_camera: FloatArray,
    prepared: PreparedPrior,
    config: RegistrationConfig,
    scene: Scene | None,
) -> float:
    """Score of a pose, at most 1: agreement of a sample of motor points less free-space violation.

    Args:
        camera_from_prior: The pose.
        sample_camera: Shape (N, 3), mm, frame `camera`: motor points, evenly spread.
        prepared: The prior.
        config: Settings.
        scene: The whole scan; without it only the agreement counts.

    Returns:
        The score, larger is better.
    """
    inverse = camera_from_prior.inverse()
    pose = PoseBatch(inverse.rotation[None], inverse.translation_mm[None])
    sample = sample_camera.astype(np.float32)
    agreement = score_batch(pose, sample, prepared, config.score_tolerance_mm)
    return float(agreement[0]) - _violation_cost(camera_from_prior, prepared, config, scene)


def _violation_cost(
    camera_from_prior: Transform,
    prepared: PreparedPrior,
    config: RegistrationConfig,
    scene: Scene | None,
) -> float:
    """What a pose loses of its score because the camera saw through it."""
    if scene is None:
        return 0.0
    standing = judge_surface(scene, camera_from_prior, prepared, tolerance_mm=3.0)
    return config.violation_weight * free_space_violation(standing)


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    pose: Transform
    score: float
    fine: FineResult | None


def _refine_candidates(
    prepared: PreparedPrior,
    points: FloatArray,
    sample: FloatArray,
    poses: PoseBatch,
    config: RegistrationConfig,
    scene: Scene | None,
) -> tuple[Registration, ...]:
    sample32 = sample.astype(np.float32)
    for distance in np.geomspace(3.0, 1.5, config.ranking_steps):
        poses = step_batch(poses, sample32, prepared, float(distance))
    transforms = poses.transforms()
    costs = [_violation_cost(pose, prepared, config, scene) for pose in transforms]
    coarse_scores = score_batch(poses, sample32, prepared, config.ranking_tolerance_mm) - costs
    final_scores = score_batch(poses, sample32, prepared, config.score_tolerance_mm) - costs
    order = np.argsort(-coarse_scores, kind="stable")
    ranked = [_Candidate(transforms[row], float(final_scores[row]), None) for row in order]
    worth = int(np.sum(coarse_scores >= coarse_scores[order[0]] - config.refined_margin))
    worth = min(worth, config.refined_candidates)
    everything = ranked[worth:]
    for candidate in ranked[:worth]:
        refined = _refine(candidate, prepared, points, config)
        if refined.fine is not None:
            score = rank_pose(refined.pose, sample, prepared, config, scene)
            refined = replace(refined, score=score)
        everything.append(refined)
    everything.sort(key=lambda candidate: (candidate.fine is None, -candidate.score))
    distinct: list[_Candidate] = []
    for candidate in everything:
        if not any(_is_same_pose(candidate, kept, prepared, config) for kept in distinct):
            distinct.append(candidate)
    return _as_registrations(distinct)


def _as_registrations(distinct: list[_Candidate]) -> tuple[Registration, ...]:
    return tuple(
        Registration(
            camera_from_prior=candidate.pose,
            converged=candidate.fine.converged,
            rms_mm=candidate.fine.rms_mm,
            inlier_ratio=candidate.fine.inlier_ratio,
            covariance=candidate.fine.covariance,
            centre_mm=candidate.fine.centre_mm,
            score=candidate.score,
            # 0 is what a pose scores that explains nothing
            runner_up_score=max([0.0, *(c.score for c in distinct if c is not candidate)]),
        )
        for candidate in distinct
        if candidate.fine is not None
    )


def _refine(
    candidate: _Candidate, prepared: PreparedPrior, points: FloatArray, config: RegistrationConfig
) -> _Candidate:
    """Refine; a candidate without a single near scan point stays as it is."""
    try:
        fine = refine_pose(candidate.pose, points, prepared, config.fine)
    except DegenerateGeometryError:
        return candidate
    return replace(candidate, pose=fine.camera_from_prior, fine=fine)


def _is_same_pose(
    first: _Candidate, second: _Candidate, prepared: PreparedPrior, config: RegistrationConfig
) -> bool:
    turn = rotation_angle_rad(first.pose.rotation.T @ second.pose.rotation)
    shift = first.pose.apply(prepared.centre_mm) - second.pose.apply(prepared.centre_mm)
    return bool(
        turn < config.coarse.cluster_angle_rad
        and np.linalg.norm(shift) < config.coarse.cluster_shift_mm
    )
