"""Carry the bolts of a prior into the robot's frame, with the uncertainty of every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.schema import HandEyeError, LocatedBolt, PriorBolt, Registration, Visibility
from boltpose.tool_fit import ToolTolerance, tool_fit_probability


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacementConfig:
    """What is known about bolts beyond what was measured."""

    bolt_tilt_sigma_rad: float = 0.0028
    """1 sigma, in either direction, of a bolt's tilt against the motor's axis: 0.16 degrees, as
    measured on the 80 sure bolts of the even families of reman18 (simulated), 0.135 on the odd
    ones. ISO 2768-2 class K allows 0.4 mm on 100 mm, 0.23 degrees at the most."""
    sure_lateral_share: float = 0.5
    """A sure bolt's sigma beside its axis, of what its prior states for the worst head that looks
    like it. Root mean square of error over stated sigma: 0.46 on the even families."""
    sure_axial_share: float = 0.65
    """The same along the axis: 0.63 on the even families."""

    def __post_init__(self) -> None:
        for name in ("sure_lateral_share", "sure_axial_share"):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be in (0, 1], got {getattr(self, name)}")
        if not 0 <= self.bolt_tilt_sigma_rad < 0.5:
            raise ConfigError(
                f"bolt_tilt_sigma_rad must be in [0, 0.5), got {self.bolt_tilt_sigma_rad}"
            )


def place_bolt(
    bolt: PriorBolt,
    registration: Registration,
    base_from_camera: Transform | None,
    *,
    visible_fraction: float,
    visibility: Visibility,
    alignment_sigma_rad: float,
    config: PlacementConfig,
    hand_eye_error: HandEyeError | None = None,
    tool: ToolTolerance | None = None,
) -> LocatedBolt:
    """Chain `base_from_camera @ camera_from_prior @ prior_from_bolt` and the covariances.

    Args:
        bolt: The bolt in its prior.
        registration: Pose of the prior in the view, with its covariance.
        base_from_camera: Hand-eye; None leaves the pose in frame `camera`.
        visible_fraction: Share of the head that the camera measured, 0 to 1.
        visibility: The same as a flag.
        alignment_sigma_rad: 1 sigma of the motor's axis in the prior.
        config: Settings.
        hand_eye_error: How well the hand-eye is known; None leaves its error out of the sigmas.
        tool: What the tool forgives; None leaves `p_tool_fits` None.

    Returns:
        The bolt in frame `base` or `camera`.

    Raises:
        FrameError: `base_from_camera` is not what its name says.

    Source:
        LCE 2024 (arXiv 2505.24669), equations 2 and 3; the covariances are ours: first-order
        propagation of a small motion about the registration's centre.
    """
    camera_from_bolt = registration.camera_from_prior @ bolt.prior_from_bolt
    position_covariance, axis_covariance = _propagate(bolt, camera_from_bolt, registration, config)
    if hand_eye_error is not None and base_from_camera is not None:
        more_position, more_axis = _hand_eye_covariance(camera_from_bolt, hand_eye_error)
        position_covariance = position_covariance + more_position
        axis_covariance = axis_covariance + more_axis
    axis = camera_from_bolt.z_axis
    beside = np.eye(3) - np.outer(axis, axis)
    lateral_variance = float(np.linalg.eigvalsh(beside @ position_covariance @ beside)[-1])
    axial_variance = float(axis @ position_covariance @ axis)
    tilt_variance = float(np.linalg.eigvalsh(beside @ axis_covariance @ beside)[-1])
    tilt_variance += alignment_sigma_rad**2 + config.bolt_tilt_sigma_rad**2
    p_tool_fits = None
    if tool is not None:
        lands = tool_fit_probability(
            position_covariance, axis, float(np.sqrt(tilt_variance)), bolt.head_height_mm, tool
        )
        p_tool_fits = bolt.confidence * lands
    pose = camera_from_bolt if base_from_camera is None else base_from_camera @ camera_from_bolt
    turn = np.eye(3) if base_from_camera is None else base_from_camera.rotation
    frame_from_prior = pose @ bolt.prior_from_bolt.inverse()
    return LocatedBolt(
        id=bolt.id,
        side=bolt.side,
        frame_from_bolt=pose,
        visible_fraction=visible_fraction,
        visibility=visibility,
        sigma_lateral_mm=float(np.sqrt(lateral_variance)),
        sigma_axial_mm=float(np.sqrt(axial_variance)),
        sigma_axis_rad=float(np.sqrt(tilt_variance)),
        covariance_mm2=turn @ position_covariance @ turn.T,
        head_diameter_mm=bolt.head_diameter_mm,
        head_height_mm=bolt.head_height_mm,
        confidence=bolt.confidence,
        is_sure=bolt.is_sure,
        cluster_centre=frame_from_prior.apply(bolt.cluster_centre),
        remarks=bolt.remarks,
        p_tool_fits=p_tool_fits,
        name=bolt.name,
        tool=bolt.tool,
        order=bolt.order,
    )


def _hand_eye_covariance(
    camera_from_bolt: Transform, error: HandEyeError
) -> tuple[FloatArray, FloatArray]:
    """What an uncertain `base_from_camera` adds, (3, 3) each, frame `camera`: mm2 and rad2.

    The camera's pose errs by a small turn about its own origin and a small shift: over the 600 mm
    to the motor a turn of 0.05 degrees is half a millimetre.
    """
    arm = camera_from_bolt.translation_mm
    turn = error.rotation_sigma_rad**2
    # the covariance of w x arm, w of equal sigma in all directions
    by_turn = turn * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return by_turn + error.translation_sigma_mm**2 * np.eye(3), turn * np.eye(3)


def _propagate(
    bolt: PriorBolt,
    camera_from_bolt: Transform,
    registration: Registration,
    config: PlacementConfig,
) -> tuple[FloatArray, FloatArray]:
    """Covariances, (3, 3) each, of the bolt's origin (mm2) and of small rotations (rad2)."""
    arm = camera_from_bolt.translation_mm - registration.centre_mm
    # a small rotation w moves the point by w x arm = -[arm]x w
    skew = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    jacobian = np.hstack([-skew, np.eye(3)])
    rotation = camera_from_bolt.rotation
    lateral_share = config.sure_lateral_share if bolt.is_sure else 1.0
    axial_share = config.sure_axial_share if bolt.is_sure else 1.0
    beside, along = lateral_share * bolt.sigma_lateral_mm, axial_share * bolt.sigma_axial_mm
    own = np.diag([beside**2, beside**2, along**2])
    position = jacobian @ registration.covariance @ jacobian.T + rotation @ own @ rotation.T
    return np.asarray(position), np.asarray(registration.covariance[:3, :3])
