"""Whether the bolts that a prior promises are still there, as far as the camera can tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy.typing as npt

from boltpose.arrays import as_points
from boltpose.geometry.transforms import Transform
from boltpose.registration.head_sight import BoltStateConfig, HeadSight, look_at_heads
from boltpose.registration.prepare import PreparedPrior
from boltpose.schema import BoltState, PriorBolt

__all__ = ["BoltJudgement", "BoltStateConfig", "HeadSight", "judge_bolts"]

_GONE_SHARE = 0.85
"""Seen through so far, a head is gone; below, something of another shape is there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltJudgement:
    """Whether one bolt of the prior is there."""

    bolt_id: str
    state: BoltState
    reason: str
    """One sentence on what was seen instead; empty unless contradicted."""
    sight: HeadSight


def judge_bolts(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    scan_points: npt.ArrayLike,
    config: BoltStateConfig | None = None,
) -> tuple[BoltJudgement, ...]:
    """Tell for every bolt of a prior whether the camera saw it, did not, or saw something else.

    Every point of a head that faces the camera is a line of sight. What was measured along it
    agrees with the head, lies behind it (then the head is not there), or lies before it (then
    something hides it, unless it has the place and size of another head).

    Args:
        prepared: The prior.
        camera_from_prior: Its verified pose.
        scan_points: Shape (N, 3), mm, frame `camera`: the whole scan, for past a missing head the
            camera may see something far behind the motor. Their order does not matter.
        config: Settings.

    Returns:
        One judgement per bolt, in the prior's order.

    Raises:
        ShapeError: `scan_points` is not (N, 3) and finite.
    """
    config = config or BoltStateConfig()
    points = as_points(scan_points, "scan_points", at_least=0)
    sights = look_at_heads(prepared, camera_from_prior, points, config)
    return tuple(
        _judge(bolt, sight, config)
        for bolt, sight in zip(prepared.prior.bolts, sights, strict=True)
    )


def _judge(bolt: PriorBolt, sight: HeadSight, config: BoltStateConfig) -> BoltJudgement:
    missing = max(config.min_points, config.min_missing_share * sight.head_points)
    present = max(config.min_points, config.min_share * sight.head_points)
    is_through = sight.through >= missing and sight.through_share >= config.through_share
    is_proud = (
        sight.proud_points >= config.min_proud_points
        and sight.proud_share >= config.proud_share
        and sight.around_points <= config.max_around_share * sight.proud_points
    )
    reason = ""
    if is_through or is_proud:
        state = BoltState.CONTRADICTED
        if is_proud and sight.proud_share > sight.through_share:
            reason = (
                f"{100 * sight.proud_share:.0f} % of the surface in the head's place is not the "
                f"head's and reaches {sight.proud_mm:+.1f} mm from its face: another head"
            )
        else:
            is_gone = sight.through_share > _GONE_SHARE and not is_proud
            reason = (
                f"the surface lies {sight.through_mm:.1f} mm behind the head's over "
                f"{100 * sight.through_share:.0f} % of what the camera saw of it: "
                f"{'a missing screw' if is_gone else 'another head'}"
            )
    else:
        state = BoltState.CONFIRMED if sight.agreeing >= present else BoltState.UNSEEN
    return BoltJudgement(bolt_id=bolt.id, state=state, reason=reason, sight=sight)
