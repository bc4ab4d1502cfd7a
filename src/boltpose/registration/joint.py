"""Poses of one motor from several views -> the pose that all of them together say.

Every view has two kinds of errors: its own, and those of the camera and its mounting that are in
all views alike, seen from the camera: a scale error puts the motor too near in every view. Seen
from `base` such an error points another way for every viewing direction, which is why views from
several sides lower it, and why two shots from one place do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import FineConfig
from boltpose.registration.covariance import depth_bias_variance_mm2
from boltpose.schema import HandEyeError, Registration

_STEPS = 3
"""Poses that agree to a millimetre and a degree are averaged to machine precision in two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointConfig:
    """How errors of several views hang together, and when views contradict each other."""

    shared_depth: float = 0.5
    """Share of the variance of the camera's depth bias that is the same in all views: its scale
    error is, its ripple depends on where in the image the motor lies. The joint pose hardly
    depends on it, its stated error does: of the true places 94 to 100 % lay in the 95 %
    ellipsoid of two or three views with a half, 88 to 94 % with none (factory, simulated)."""
    shared_hand_eye: float = 0.5
    """The same of the hand-eye's error: its calibration is the same in all views of one camera,
    the robot's own error is not. Of several cameras nothing is; half is then on the safe side."""
    max_distance_sigmas: float = 7.0
    """Two views further apart than this, in units of what both state of themselves, contradict
    each other. Mahalanobis distance in six dimensions: at most 4.3 in all pairs of 48 views of
    the factory, all of which were known when it was set (simulated;
    `evaluation.several_views_run`)."""

    veto_factor: float = 1.5
    """All views together are held against the thresholds for one. A single view vetoes when what it
    lacks is this many times what one view may lack: with `min_tight` 0.94, at 9 % of its points
    off the surface."""

    def __post_init__(self) -> None:
        for name in ("shared_depth", "shared_hand_eye"):
            value = getattr(self, name)
            # at 1 views from one direction would say nothing of each other's depth
            if not 0 <= value <= 0.99:
                raise ConfigError(f"{name} must be 0 to 0.99, got {value}")
        if not self.max_distance_sigmas > 0:
            raise ConfigError(f"max_distance_sigmas must be > 0, got {self.max_distance_sigmas}")
        if not self.veto_factor >= 1:
            raise ConfigError(f"veto_factor must be >= 1, got {self.veto_factor}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PoseEstimate:
    """What one view says of the motor's pose, in frame `base`.

    Errors are small motions, six numbers: rotation vector (rad), translation (mm), about the
    motor's centre.
    """

    base_from_prior: Transform
    own_covariance: FloatArray
    """Shape (6, 6): of the errors that are this view's alone."""
    shared: FloatArray
    """Shape (6, 7): what the errors that all views have alike, each of variance 1, do here."""

    @property
    def covariance(self) -> FloatArray:
        """Shape (6, 6): of all errors together."""
        return np.asarray(self.own_covariance + self.shared @ self.shared.T)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Disagreement:
    """How far the two views are apart that agree least."""

    first: int
    second: int
    """Rows of the estimates."""
    distance_sigmas: float
    """Mahalanobis distance in six dimensions."""
    shift_mm: float
    """Of the motor's centre."""
    turn_rad: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FusedPose:
    """The pose that all views together say."""

    base_from_prior: Transform
    covariance: FloatArray
    """Shape (6, 6): a small motion in `base` about the motor's centre."""
    worst: Disagreement | None
    """None if there is one view alone."""


def estimate_in_base(
    registration: Registration,
    base_from_camera: Transform,
    hand_eye_error: HandEyeError | None,
    fine: FineConfig,
    config: JointConfig,
) -> PoseEstimate:
    """Carry a view's pose and what is known of its errors into frame `base`.

    Args:
        registration: The pose of one view.
        base_from_camera: Where its camera was.
        hand_eye_error: How well that is known; None takes it for exact.
        fine: With what the pose was refined: holds the camera's depth bias.
        config: Settings.

    Returns:
        The estimate.
    """
    turn = np.kron(np.eye(2), base_from_camera.rotation)
    arm = registration.centre_mm
    shared = np.zeros((6, 7))
    # what the covariance of a view holds along its line of sight
    bias = depth_bias_variance_mm2(arm, fine)
    shared[3:, 0] = np.sqrt(config.shared_depth * bias) * arm / np.linalg.norm(arm)
    own = registration.covariance - np.outer(shared[:, 0], shared[:, 0])
    if hand_eye_error is not None:
        spread = np.repeat(
            [hand_eye_error.rotation_sigma_rad, hand_eye_error.translation_sigma_mm], 3
        )
        moved = _seen_from(arm) * spread
        shared[:, 1:] = np.sqrt(config.shared_hand_eye) * moved
        own = own + (1.0 - config.shared_hand_eye) * moved @ moved.T
    own = turn @ own @ turn.T
    return PoseEstimate(
        base_from_prior=base_from_camera @ registration.camera_from_prior,
        own_covariance=0.5 * (own + own.T),
        shared=turn @ shared,
    )


def fuse_poses(estimates: Sequence[PoseEstimate], centre_prior: FloatArray) -> FusedPose:
    """Average poses, each by what it knows, errors that views share taken into account.

    Args:
        estimates: At least one.
        centre_prior: Shape (3,), mm, frame `prior`: the motor's centre.

    Returns:
        The best linear estimate and its covariance, with the pair of views that agrees least.

    Source:
        Aitken's generalised least squares on the tangent space of SE(3), as in Barfoot and
        Furgale, IEEE T-RO 30(3), 2014, section IV; shared errors are ours.
    """
    count = len(estimates)
    together = np.concatenate([estimate.shared for estimate in estimates])
    covariance = together @ together.T
    for row, estimate in enumerate(estimates):
        block = slice(6 * row, 6 * row + 6)
        covariance[block, block] += estimate.own_covariance
    design = np.tile(np.eye(6), (count, 1))
    scale = 1.0 / np.sqrt(np.diag(covariance))
    # rad and mm differ by orders of magnitude: solved in units of sigma
    whitened = np.linalg.inv(covariance * np.outer(scale, scale)) * np.outer(scale, scale)
    information = design.T @ whitened @ design
    gain = np.linalg.solve(information, design.T @ whitened)
    pose = estimates[0].base_from_prior
    for _ in range(_STEPS):
        offsets = [_motion(pose, other.base_from_prior, centre_prior) for other in estimates]
        pose = _moved(pose, gain @ np.concatenate(offsets), centre_prior)
    fused = np.linalg.inv(information)
    return FusedPose(
        base_from_prior=pose,
        covariance=0.5 * (fused + fused.T),
        worst=_find_worst_pair(estimates, centre_prior),
    )


def distance_sigmas(one: PoseEstimate, two: PoseEstimate, centre_prior: FloatArray) -> float:
    """How far two views' poses are apart, in units of what both state of their errors.

    Args:
        one: The pose of one view.
        two: That of another.
        centre_prior: Shape (3,), mm, frame `prior`: the motor's centre.

    Returns:
        Mahalanobis distance in six dimensions.
    """
    motion = _motion(one.base_from_prior, two.base_from_prior, centre_prior)
    between = one.shared - two.shared
    covariance = one.own_covariance + two.own_covariance + between @ between.T
    scale = 1.0 / np.sqrt(np.diag(covariance))
    scaled = motion * scale
    squared = scaled @ np.linalg.solve(covariance * np.outer(scale, scale), scaled)
    return float(np.sqrt(max(float(squared), 0.0)))


def _find_worst_pair(
    estimates: Sequence[PoseEstimate], centre_prior: FloatArray
) -> Disagreement | None:
    pairs = list(combinations(range(len(estimates)), 2))
    if not pairs:
        return None
    distances = [
        distance_sigmas(estimates[first], estimates[second], centre_prior)
        for first, second in pairs
    ]
    worst = int(np.argmax(distances))
    first, second = pairs[worst]
    motion = _motion(
        estimates[first].base_from_prior, estimates[second].base_from_prior, centre_prior
    )
    return Disagreement(
        first=first,
        second=second,
        distance_sigmas=distances[worst],
        shift_mm=float(np.linalg.norm(motion[3:])),
        turn_rad=float(np.linalg.norm(motion[:3])),
    )


def _motion(start: Transform, end: Transform, centre_prior: FloatArray) -> FloatArray:
    """Shape (6,): the motion in `base`, about the motor's centre, from one pose to another."""
    turn = Rotation.from_matrix(end.rotation @ start.rotation.T).as_rotvec()
    return np.concatenate([turn, end.apply(centre_prior) - start.apply(centre_prior)])


def _moved(pose: Transform, motion: FloatArray, centre_prior: FloatArray) -> Transform:
    rotation = Rotation.from_rotvec(motion[:3]).as_matrix() @ pose.rotation
    centre = pose.apply(centre_prior) + motion[3:]
    return Transform.from_parts(
        pose.target, pose.source, rotation, centre - rotation @ np.asarray(centre_prior)
    )


def _seen_from(arm: FloatArray) -> FloatArray:
    """Shape (6, 6): a motion about a point -> the same motion told about the point `arm` from it.

    A small rotation w moves that point by w x arm = -[arm]x w.
    """
    jacobian = np.eye(6)
    jacobian[3:, :3] = [[0, arm[2], -arm[1]], [-arm[2], 0, arm[0]], [arm[1], -arm[0], 0]]
    return jacobian
