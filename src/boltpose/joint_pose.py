"""What several views make of one motor: the pose that suits all, refined in each, averaged."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, DegenerateGeometryError
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.locate_config import LocateConfig
from boltpose.registration.config import VerifyConfig
from boltpose.registration.evidence import Evidence, gather_evidence
from boltpose.registration.icp import refine_pose
from boltpose.registration.joint import (
    FusedPose,
    JointConfig,
    PoseEstimate,
    distance_sigmas,
    estimate_in_base,
    fuse_poses,
)
from boltpose.registration.pooled import SeenPose
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.register import rank_pose
from boltpose.registration.verify import decide
from boltpose.schema import HandEyeError, Registration, Scan, Verdict
from boltpose.view import View, register_again, register_view


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shot:
    """A scan and where the camera was."""

    scan: Scan
    base_from_camera: Transform
    hand_eye_error: HandEyeError | None = None
    """How well `base_from_camera` is known; None takes it for exact."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SeenShot:
    """A view with all that was found in it alone."""

    shot: Shot
    view: View
    digest: str
    candidates: tuple[Registration, ...]
    sample: FloatArray
    """Shape (K, 3): motor points that rank poses."""
    weight: int
    """Motor points on 2 mm voxels."""

    @property
    def camera_from_base(self) -> Transform:
        """Where the base is, seen from the camera."""
        return self.shot.base_from_camera.inverse()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JudgedShot:
    """The joint hypothesis in one view."""

    seen: SeenShot
    registration: Registration | None
    """Refined in this view; None if the view does not hold it there."""
    pose: SeenPose
    verdict: Verdict
    has_say: bool
    """Whether it sees enough of the motor to contradict."""


def look_at(shot: Shot, view: View, prepared: PreparedPrior, config: LocateConfig) -> SeenShot:
    """Register a view alone."""
    points = view.motor_points
    thinned = voxel_downsample(points, 2.0) if len(points) else points
    order = np.random.default_rng(config.registration.coarse.seed).permutation(len(thinned))
    return SeenShot(
        shot=shot,
        view=view,
        digest=hashlib.sha256(np.ascontiguousarray(view.points).tobytes()).hexdigest(),
        candidates=register_view(view, prepared, config).candidates,
        sample=thinned[order[: config.registration.ranking_points]],
        weight=len(thinned),
    )


def sort_by_content(seen: list[SeenShot]) -> list[SeenShot]:
    """Sort by content, so that the order in which views were given does not matter."""
    ordered = sorted(seen, key=lambda one: one.digest)
    for one, two in pairwise(ordered):
        if one.digest == two.digest and len(one.view.points):
            raise ConfigError(
                f"views must be different scans, got the same points from "
                f"{one.shot.scan.source} and {two.shot.scan.source}"
            )
    return ordered


def choose_pose(
    seen: list[SeenShot], prepared: PreparedPrior, config: LocateConfig
) -> tuple[Transform, float, float] | None:
    """`base_from_prior` that suits all views best, its score, and that of the best other one."""
    poses: list[Transform] = []
    for one in seen:
        for candidate in one.candidates:
            pose = one.shot.base_from_camera @ candidate.camera_from_prior
            if not any(is_near(pose, other, prepared, config) for other in poses):
                poses.append(pose)
    if not poses:
        return None
    total = float(sum(one.weight for one in seen))
    scores = [
        sum(one.weight * _score(one, pose, prepared, config) for one in seen) / total
        for pose in poses
    ]
    best = int(np.argmax(scores))
    # 0 is what a pose scores that explains nothing
    return poses[best], scores[best], max([0.0, *scores[:best], *scores[best + 1 :]])


def _score(
    one: SeenShot, base_from_prior: Transform, prepared: PreparedPrior, config: LocateConfig
) -> float:
    if not len(one.sample):
        return 0.0
    near = _near_candidate(one, base_from_prior, prepared, config)
    if near is not None:
        return near.score
    return rank_pose(
        one.camera_from_base @ base_from_prior,
        one.sample,
        prepared,
        config.registration,
        one.view.scene,
    )


def _near_candidate(
    one: SeenShot, base_from_prior: Transform, prepared: PreparedPrior, config: LocateConfig
) -> Registration | None:
    for candidate in one.candidates:
        pose = one.shot.base_from_camera @ candidate.camera_from_prior
        if is_near(pose, base_from_prior, prepared, config):
            return candidate
    return None


def is_near(one: Transform, two: Transform, prepared: PreparedPrior, config: LocateConfig) -> bool:
    """Whether two poses of the motor are the same but for their errors."""
    coarse = config.registration.coarse
    shift = one.apply(prepared.centre_mm) - two.apply(prepared.centre_mm)
    return bool(
        rotation_angle_rad(one.rotation.T @ two.rotation) < coarse.cluster_angle_rad
        and np.linalg.norm(shift) < coarse.cluster_shift_mm
    )


def judge_pose(
    one: SeenShot, hypothesis: Transform, prepared: PreparedPrior, config: LocateConfig
) -> JudgedShot:
    """Refine the joint hypothesis in a view and ask the view what it thinks of it."""
    registration = _refine(one, hypothesis, prepared, config)
    asked = registration or _unrefined(one.camera_from_base @ hypothesis, prepared)
    evidence = gather_evidence(
        asked, prepared, one.view.scene, one.view.motor_points, config.verification.evidence
    )
    return JudgedShot(
        seen=one,
        registration=registration,
        pose=SeenPose(
            camera_from_prior=asked.camera_from_prior,
            motor_points=one.view.motor_points,
            scene=one.view.scene,
            evidence=evidence,
        ),
        verdict=decide(evidence, config.verification),
        has_say=_has_say(evidence, config.verification),
    )


def _refine(
    one: SeenShot, hypothesis: Transform, prepared: PreparedPrior, config: LocateConfig
) -> Registration | None:
    start = _near_candidate(one, hypothesis, prepared, config)
    if start is None:
        pose = one.camera_from_base @ hypothesis
        try:
            fine = refine_pose(pose, one.view.motor_points, prepared, config.registration.fine)
        except DegenerateGeometryError:
            return None
        start = Registration(
            camera_from_prior=fine.camera_from_prior,
            converged=fine.converged,
            rms_mm=fine.rms_mm,
            inlier_ratio=fine.inlier_ratio,
            covariance=fine.covariance,
            centre_mm=fine.centre_mm,
            score=0.0,
            runner_up_score=0.0,
        )
    refined = register_again(start, one.view, prepared, config)
    pose = one.shot.base_from_camera @ refined.camera_from_prior
    # slid away or still sliding: what is seen here does not hold the pose
    is_held = refined.converged and is_near(pose, hypothesis, prepared, config)
    return refined if is_held else None


def _unrefined(pose: Transform, prepared: PreparedPrior) -> Registration:
    return Registration(
        camera_from_prior=pose,
        converged=False,
        rms_mm=0.0,
        inlier_ratio=0.0,
        covariance=np.eye(6),
        centre_mm=pose.apply(prepared.centre_mm),
        score=0.0,
        runner_up_score=0.0,
    )


def _has_say(evidence: Evidence, config: VerifyConfig) -> bool:
    return (
        evidence.motor_points >= config.min_motor_points
        and evidence.judged_points >= config.min_judged_points
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fusion:
    """How the joint pose came about."""

    used: tuple[JudgedShot, ...]
    """The views that it was averaged from."""
    fused: FusedPose | None
    """None if not one view could be refined."""
    points_covariance: FloatArray | None = None
    """Shape (6, 6), like `fused.covariance`, as if every camera pose were exact: what the points
    alone leave open."""


def fuse_shots(
    judged: list[JudgedShot], prepared: PreparedPrior, config: LocateConfig, joint: JointConfig
) -> Fusion:
    """Average the views; one that sees little and is off takes no part, one that sees much does."""

    def estimate(one: JudgedShot, error: HandEyeError | None) -> PoseEstimate | None:
        if one.registration is None:
            return None
        return estimate_in_base(
            one.registration,
            one.seen.shot.base_from_camera,
            error,
            config.registration.fine,
            joint,
        )

    found_in = [(one, estimate(one, one.seen.shot.hand_eye_error)) for one in judged]
    refined = [(one, found) for one, found in found_in if found is not None]
    sure = [pair for pair in refined if pair[0].has_say] or refined
    limit = joint.max_distance_sigmas
    used = [
        (one, found)
        for one, found in refined
        if any(one is other for other, _ in sure)
        or all(distance_sigmas(found, other, prepared.centre_mm) <= limit for _, other in sure)
    ]
    if not used:
        return Fusion(used=(), fused=None)
    exact = [found for one, _ in used if (found := estimate(one, None)) is not None]
    return Fusion(
        used=tuple(one for one, _ in used),
        fused=fuse_poses([found for _, found in used], prepared.centre_mm),
        points_covariance=fuse_poses(exact, prepared.centre_mm).covariance,
    )


def describe_joint_pose(
    fusion: Fusion,
    reference: SeenShot,
    hypothesis: Transform,
    score: float,
    runner_up: float,
    prepared: PreparedPrior,
) -> Registration:
    """Tell the joint pose as one of the cameras would."""
    if fusion.fused is None:
        pose = reference.camera_from_base @ hypothesis
        return replace(_unrefined(pose, prepared), score=score, runner_up_score=runner_up)
    pose = reference.camera_from_base @ fusion.fused.base_from_prior
    turn = np.kron(np.eye(2), reference.camera_from_base.rotation)
    known = [one.registration for one in fusion.used if one.registration is not None]
    counts = np.array([one.pose.evidence.motor_points for one in fusion.used], dtype=np.float64)
    counts /= max(float(counts.sum()), 1.0)
    return Registration(
        camera_from_prior=pose,
        converged=True,
        rms_mm=float(np.sqrt(counts @ np.array([one.rms_mm**2 for one in known]))),
        inlier_ratio=float(counts @ np.array([one.inlier_ratio for one in known])),
        covariance=turn @ fusion.fused.covariance @ turn.T,
        centre_mm=pose.apply(prepared.centre_mm),
        score=score,
        runner_up_score=runner_up,
    )
