"""What the camera saw of every bolt, and every bolt's place in the robot's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from boltpose.arrays import BoolArray
from boltpose.geometry.sampling import canonical_rows
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.placement import place_bolt
from boltpose.registration.bolt_state import BoltJudgement, judge_bolts
from boltpose.registration.extra_heads import find_extra_heads
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.relabel import relabel
from boltpose.registration.visibility import BoltSight, see_bolts
from boltpose.schema import BoltState, ExtraHead, HandEyeError, LocatedBolt, Registration
from boltpose.view import View, points_around

_STATES = (BoltState.CONTRADICTED, BoltState.CONFIRMED, BoltState.UNSEEN)
"""Of several views of a bolt the first in this order counts: a doubt outweighs a confirmation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenBolt:
    """One bolt in one or several views."""

    sight: BoltSight
    judgement: BoltJudgement


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SeenHeads:
    """What a view shows of all heads, those of the prior and others."""

    bolts: tuple[SeenBolt, ...]
    """In the prior's order."""
    extra: tuple[ExtraHead, ...]
    """Frame `camera`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Found:
    """What a result holds besides its pose and verdict."""

    bolts: tuple[LocatedBolt, ...] = ()
    extra_heads: tuple[ExtraHead, ...] = ()
    motor_mask: BoolArray | None = None


def find_in_view(
    registration: Registration,
    view: View,
    prepared: PreparedPrior,
    base_from_camera: Transform | None,
    config: LocateConfig,
    *,
    hand_eye_error: HandEyeError | None = None,
) -> Found:
    """Place all bolts by a verified pose, and tell what the camera saw of them.

    Args:
        registration: The pose.
        view: What the camera saw.
        prepared: The prior.
        base_from_camera: Hand-eye; None leaves everything in frame `camera`.
        config: Settings.
        hand_eye_error: How well the hand-eye is known.
    """
    pose = registration.camera_from_prior
    seen = look_at_heads(view, prepared, pose, config)
    mask: BoolArray | None = None
    if config.label_scan:
        threshold_mm = config.relabel_mm or LocateConfig().relabel_mm
        mask = relabel(prepared, pose, view.scan.points, threshold_mm=threshold_mm)
    return Found(
        bolts=place_bolts(
            registration,
            seen.bolts,
            prepared,
            base_from_camera,
            config,
            hand_eye_error=hand_eye_error,
        ),
        extra_heads=move_heads(seen.extra, base_from_camera),
        motor_mask=mask,
    )


def look_at_heads(
    view: View, prepared: PreparedPrior, camera_from_prior: Transform, config: LocateConfig
) -> SeenHeads:
    """Tell how much of every bolt a view shows, and whether it is what the prior promises.

    Args:
        view: What the camera saw.
        prepared: The prior.
        camera_from_prior: Its verified pose.
        config: Settings.
    """
    around = points_around(view.scan, camera_from_prior, prepared, config)
    sights = see_bolts(prepared, camera_from_prior, around, config.visibility)
    # past a missing head the camera may see something far behind the motor: the whole scan counts
    points = view.scan.points
    if len(points) > config.max_state_points:
        points = points[canonical_rows(points, config.max_state_points)]
    judgements = judge_bolts(prepared, camera_from_prior, points, config.bolt_state)
    return SeenHeads(
        bolts=tuple(
            SeenBolt(sight=sight, judgement=judgement)
            for sight, judgement in zip(sights, judgements, strict=True)
        ),
        # chosen points, as its settings were measured: more of them make clamps look like heads
        extra=find_extra_heads(prepared, camera_from_prior, view.points, config.extra_heads),
    )


def move_heads(
    heads: Sequence[ExtraHead], base_from_camera: Transform | None
) -> tuple[ExtraHead, ...]:
    """Carry heads from frame `camera` to `base`; None leaves them there."""
    if base_from_camera is None:
        return tuple(heads)
    return tuple(
        replace(head, head_top_mm=base_from_camera.apply(head.head_top_mm)) for head in heads
    )


def join_views(views: Sequence[tuple[SeenBolt, ...]]) -> tuple[SeenBolt, ...]:
    """Take the best sight of every bolt, and the gravest judgement, over views of one clamping."""
    return tuple(
        SeenBolt(
            sight=max((seen.sight for seen in row), key=lambda sight: sight.visible_fraction),
            judgement=min(
                (seen.judgement for seen in row),
                key=lambda judgement: _STATES.index(judgement.state),
            ),
        )
        for row in zip(*views, strict=True)
    )


def place_bolts(
    registration: Registration,
    bolts: Sequence[SeenBolt],
    prepared: PreparedPrior,
    base_from_camera: Transform | None,
    config: LocateConfig,
    *,
    hand_eye_error: HandEyeError | None = None,
) -> tuple[LocatedBolt, ...]:
    """Carry all bolts of a prior into the result's frame.

    Args:
        registration: A verified pose.
        bolts: What was seen of them, in the prior's order.
        prepared: The prior.
        base_from_camera: Hand-eye; None leaves the bolts in frame `camera`.
        config: Settings.
        hand_eye_error: How well the hand-eye is known, where the registration's covariance does
            not hold it already.

    Returns:
        The bolts. No tool fits one that is contradicted.
    """
    placed = []
    for bolt, seen in zip(prepared.prior.bolts, bolts, strict=True):
        located = place_bolt(
            bolt,
            registration,
            base_from_camera,
            visible_fraction=seen.sight.visible_fraction,
            visibility=seen.sight.visibility,
            alignment_sigma_rad=prepared.prior.alignment.axis_sigma_rad,
            config=config.placement,
            hand_eye_error=hand_eye_error,
            tool=config.tool,
        )
        state = seen.judgement.state
        if state is BoltState.CONTRADICTED and located.p_tool_fits is not None:
            located = replace(located, p_tool_fits=0.0)
        placed.append(replace(located, state=state, state_reason=seen.judgement.reason))
    return tuple(placed)
