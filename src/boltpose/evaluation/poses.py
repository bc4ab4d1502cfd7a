"""Compare the result of one view with the true pose of the motor and of every bolt."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from boltpose.errors import FrameError
from boltpose.evaluation.bolts import BoltError, measure_bolt_error
from boltpose.evaluation.reman18 import TrueBolt, TrueView
from boltpose.geometry.transforms import Transform, angle_between_rad, rotation_angle_rad
from boltpose.schema import LocatedBolt, LocateResult, Status, Visibility

WRONG_MM = 2.0
"""A pose that puts a bolt of the true motor model further off than this is wrong (issue 2)."""
WRONG_RAD = math.radians(2.0)
"""The same for a bolt's axis."""
GOOD_LATERAL_MM = 1.0
"""A scene is good if every bolt is at most this far beside its true axis (issue 2)."""
GOOD_AXIS_RAD = math.radians(1.0)
"""And its axis at most this far off."""
LATERAL_LIMIT = math.sqrt(5.991464547107979)
"""95 % of a round normal distribution in two dimensions lie within this many sigma."""
AXIAL_LIMIT = 1.959963984540054
"""The same in one dimension."""

POSITION_LIMIT = math.sqrt(7.814727903251179)
"""The same in three dimensions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseError:
    """The rigid error of a pose, told by what it does to the bolts of the *true* motor model."""

    worst_bolt_mm: float
    """Largest distance between a true `head_top` moved by the found and by the true pose."""
    worst_axis_rad: float
    """The same for the bolts' axes."""
    rotation_rad: float
    """Angle between the two poses."""

    @property
    def is_wrong(self) -> bool:
        """True if a tool sent to that pose would miss a bolt."""
        return self.worst_bolt_mm > WRONG_MM or self.worst_axis_rad > WRONG_RAD


@dataclass(frozen=True, slots=True, kw_only=True)
class LocatedBoltRecord:
    """One located bolt beside the true one."""

    found_id: str
    true_id: int
    is_sure: bool
    error: BoltError
    """In the frame of the result, `base`."""
    sigma_lateral_mm: float
    sigma_axial_mm: float
    sigma_axis_rad: float
    position_sigmas: float
    """Error of `head_top` in units of the stated covariance (Mahalanobis distance)."""
    is_truly_visible: bool
    visibility: Visibility
    visible_fraction: float
    true_visible_fraction: float

    @property
    def is_good(self) -> bool:
        """Within 1 mm lateral and 1 degree."""
        return self.error.lateral_mm <= GOOD_LATERAL_MM and self.error.axis_rad <= GOOD_AXIS_RAD

    @property
    def is_said_visible(self) -> bool:
        """True if the result calls it visible or partly visible."""
        return self.visibility is not Visibility.HIDDEN

    @property
    def is_lateral_covered(self) -> bool:
        """True if the stated 95 % circle about the found point holds the true axis."""
        return self.error.lateral_mm <= LATERAL_LIMIT * self.sigma_lateral_mm

    @property
    def is_position_covered(self) -> bool:
        """True if the stated 95 % ellipsoid holds the true `head_top`."""
        return self.position_sigmas <= POSITION_LIMIT

    @property
    def is_axial_covered(self) -> bool:
        """True if the stated 95 % interval along the axis holds the true `head_top`."""
        return abs(self.error.axial_mm) <= AXIAL_LIMIT * self.sigma_axial_mm

    @property
    def is_axis_covered(self) -> bool:
        """True if the stated 95 % cone holds the true axis."""
        return self.error.axis_rad <= LATERAL_LIMIT * self.sigma_axis_rad


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseRecord:
    """What one `locate` call said about a view and how true it is."""

    status: Status
    failed: tuple[str, ...]
    """Names of the failed checks, empty when ok."""
    reasons: tuple[str, ...]
    scores: Mapping[str, float]
    pose: PoseError | None
    """Of the candidate pose, also of a refused one; None if there was no candidate."""
    bolts: tuple[LocatedBoltRecord, ...]
    """Located bolts that stand for a true one. The partner is the one that the same id has in
    the prior: a pose that swaps two alike bolts is seen."""
    missed: tuple[int, ...]
    """True bolts that are not in the result; all of them when it is refused."""
    false: tuple[str, ...]
    """Ids of located bolts that stand for no true one."""

    @property
    def is_ok(self) -> bool:
        """The result may be used, says the verdict."""
        return self.status is Status.OK

    @property
    def is_wrong_accepted(self) -> bool:
        """The worst thing: a wrong pose reported ok. A pose that cannot be judged is wrong."""
        return self.is_ok and (self.pose is None or self.pose.is_wrong)

    @property
    def is_scene_good(self) -> bool:
        """Ok, and every bolt of the motor is there within 1 mm lateral and 1 degree."""
        return self.is_ok and not self.missed and all(bolt.is_good for bolt in self.bolts)


def measure_pose_error(found: Transform, truth: Transform, bolts: Sequence[TrueBolt]) -> PoseError:
    """Move the bolts of the true motor by two poses and compare.

    Args:
        found: `camera_from_prior` as located.
        truth: `camera_from_prior` as it was.
        bolts: The true bolts, frame `prior`.

    Returns:
        The error.

    Raises:
        FrameError: The two poses are not of the same frames.
        ValueError: There is no bolt to judge by.
    """
    if (found.target, found.source) != (truth.target, truth.source):
        raise FrameError(
            f"found is {found.target}_from_{found.source}, "
            f"truth is {truth.target}_from_{truth.source}"
        )
    if not bolts:
        raise ValueError("a pose is judged by bolts, got none")
    tops = np.array([bolt.head_top_mm for bolt in bolts])
    axes = np.array([bolt.axis for bolt in bolts])
    shift = np.linalg.norm(found.apply(tops) - truth.apply(tops), axis=1)
    tilt = angle_between_rad(found.rotate(axes), truth.rotate(axes))
    return PoseError(
        worst_bolt_mm=float(shift.max()),
        worst_axis_rad=float(tilt.max()),
        rotation_rad=rotation_angle_rad(found.rotation.T @ truth.rotation),
    )


def compare_with_truth(
    result: LocateResult,
    view: TrueView,
    bolts: Sequence[TrueBolt],
    true_id_of: Mapping[str, int],
) -> PoseRecord:
    """Judge the result of one view.

    Args:
        result: What `locate` returned.
        view: The truth of the view.
        bolts: The true bolts of the motor, frame `prior`.
        true_id_of: Number of the true bolt by the id it has in the prior (`match_bolts`).

    Returns:
        The record.

    Raises:
        FrameError: The result is in another frame than `base` or `camera`.
    """
    truth = {bolt.id: bolt for bolt in bolts}
    partners = {b.id: true_id_of[b.id] for b in result.bolts if b.id in true_id_of}
    pose = None
    if result.registration is not None:
        pose = measure_pose_error(
            result.registration.camera_from_prior, view.camera_from_prior, bolts
        )
    return PoseRecord(
        status=result.verdict.status,
        failed=tuple(str(check) for check in result.verdict.failed),
        reasons=result.verdict.reasons,
        scores={name: float(value) for name, value in result.verdict.scores.items()},
        pose=pose,
        bolts=tuple(
            _bolt_record(bolt, truth[partners[bolt.id]], view)
            for bolt in result.bolts
            if bolt.id in partners
        ),
        missed=tuple(sorted(set(truth) - set(partners.values()))),
        false=tuple(bolt.id for bolt in result.bolts if bolt.id not in partners),
    )


def _bolt_record(bolt: LocatedBolt, truth: TrueBolt, view: TrueView) -> LocatedBoltRecord:
    frame_from_prior = _frame_from_prior(bolt.frame_from_bolt.target, view)
    true_top = frame_from_prior.apply(truth.head_top_mm)
    offset = bolt.head_top - true_top
    seen = view.visibility[truth.id]
    return LocatedBoltRecord(
        found_id=bolt.id,
        true_id=truth.id,
        is_sure=bolt.is_sure,
        error=measure_bolt_error(
            bolt.head_top, bolt.axis, true_top, frame_from_prior.rotate(truth.axis)
        ),
        sigma_lateral_mm=bolt.sigma_lateral_mm,
        sigma_axial_mm=bolt.sigma_axial_mm,
        sigma_axis_rad=bolt.sigma_axis_rad,
        position_sigmas=math.sqrt(float(offset @ np.linalg.solve(bolt.covariance_mm2, offset))),
        is_truly_visible=seen.is_visible,
        visibility=bolt.visibility,
        visible_fraction=bolt.visible_fraction,
        true_visible_fraction=seen.fraction,
    )


def _frame_from_prior(frame: str, view: TrueView) -> Transform:
    if frame == "camera":
        return view.camera_from_prior
    if frame == "base":
        return view.base_from_camera @ view.camera_from_prior
    raise FrameError(f"bolts must be in frame 'base' or 'camera', got '{frame}'")
