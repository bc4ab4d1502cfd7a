"""The targets of the main job (issues 2 and 4), each measured from the records and met or not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from boltpose.evaluation.bolts import BoltMatch
from boltpose.evaluation.masks import score_masks
from boltpose.evaluation.poses import LocatedBoltRecord
from boltpose.evaluation.records import MotorRecord, Outcome, ViewRecord
from boltpose.evaluation.statistics import share_of, spread_of

PREPARE_STAGE = "prepare prior"
"""Stage of `locate` that a service does once per motor, not once per scan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One promise and what became of it."""

    name: str
    wanted: str
    measured: str
    is_met: bool | None
    """None: nothing was measured that could tell."""


def all_matches(records: Sequence[MotorRecord]) -> list[BoltMatch]:
    """Matched bolts of all priors."""
    return [match for record in records for match in record.prior.bolts.matches]


def all_views(records: Sequence[MotorRecord]) -> list[ViewRecord]:
    """Views of all motors."""
    return [view for record in records for view in record.views]


def accepted_bolts(records: Sequence[MotorRecord]) -> list[LocatedBoltRecord]:
    """Located bolts of all views reported ok."""
    return [b for view in all_views(records) if view.result.is_ok for b in view.result.bolts]


def judge_targets(records: Sequence[MotorRecord]) -> tuple[Target, ...]:
    """Hold the records against the targets.

    Args:
        records: One per motor.

    Returns:
        The targets in the order of the issue.
    """
    return (*_prior_targets(records), *_view_targets(records), *_cost_targets(records))


def _prior_targets(records: Sequence[MotorRecord]) -> list[Target]:
    matches = all_matches(records)
    found_false = sum(len(record.prior.bolts.false) for record in records)
    sure_false = sum(b.is_sure for record in records for b in record.prior.bolts.false)
    true_bolts = sum(record.true_bolts for record in records)
    found = len(matches) + found_false
    sure = [match for match in matches if match.is_sure]
    worst = max((match.error.lateral_mm for match in sure), default=None)
    return [
        _share("bolts of the priors: recall", len(matches), true_bolts, 0.995),
        _share("bolts of the priors: precision", len(matches), found, 0.99),
        _share(
            "bolts of the priors: side right",
            sum(match.is_side_right for match in matches),
            len(matches),
            1.0,
        ),
        _share("bolts of the priors: found and marked sure", len(sure), true_bolts, 0.96),
        _limit("sure bolts: largest distance beside the true axis", worst, 0.5, "mm"),
        _count("sure bolts that are none", sure_false, found),
    ]


def _view_targets(records: Sequence[MotorRecord]) -> list[Target]:
    views = all_views(records)
    ok = [view for view in views if view.result.is_ok]
    bolts = accepted_bolts(records)
    lateral = spread_of(bolt.error.lateral_mm for bolt in bolts)
    axis = spread_of(math.degrees(bolt.error.axis_rad) for bolt in bolts)
    cases = [case for record in records for case in record.cases]
    masks = score_masks([view.mask for view in ok if view.mask is not None])
    return [
        _least(
            "scene after relabelling: overall accuracy", masks and masks.overall_accuracy, 0.995
        ),
        _least("scene after relabelling: mIoU", masks and masks.mean_iou, 0.985),
        _share("views reported ok", len(ok), len(views), 0.97),
        _count("wrong poses reported ok", sum(v.result.is_wrong_accepted for v in ok), len(views)),
        _limit("all bolts, lateral error, median", lateral and lateral.median, 0.15, "mm"),
        _limit("all bolts, lateral error, 95 %", lateral and lateral.p95, 0.4, "mm"),
        _limit("all bolts, axis error, median", axis and axis.median, 0.15, "deg"),
        _coverage("95 % regions that hold the true position", bolts),
        _count(
            "must-be-refused scans accepted wrongly",
            sum(case.outcome is Outcome.WRONG for case in cases),
            len(cases),
        ),
    ]


def _cost_targets(records: Sequence[MotorRecord]) -> list[Target]:
    calls = [view.time for view in all_views(records) if view.time.wall_s > 0]
    locate = spread_of(call.wall_s for call in calls)
    prepared = spread_of(call.wall_s - call.stage_s(PREPARE_STAGE) for call in calls)
    build = spread_of(record.prior.time.wall_s for record in records)
    memory = max((record.peak_memory_mb for record in records), default=None)
    return [
        _limit("locate, median wall time", locate and locate.median, 1.0, "s"),
        _limit("the same, prior prepared before", prepared and prepared.median, 1.0, "s"),
        _limit("prior build, slowest, wall time", build and build.maximum, 20.0, "s"),
        _limit("peak memory", memory, 1500.0, "MB"),
    ]


def _share(name: str, part: int, whole: int, wanted: float) -> Target:
    share = part / whole if whole else None
    return Target(
        name=name,
        wanted=f"{'all' if wanted == 1 else f'>= {100 * wanted:g} %'}",
        measured="nothing" if share is None else f"{part} of {whole}, {100 * share:.1f} %",
        is_met=None if share is None else share >= wanted,
    )


def _coverage(name: str, bolts: Sequence[LocatedBoltRecord]) -> Target:
    share = share_of(bolt.is_position_covered for bolt in bolts)
    return Target(
        name=name,
        wanted=">= 90 %",
        measured="nothing" if share is None else f"{100 * share:.1f} % of {len(bolts)}",
        is_met=None if share is None else share >= 0.9,
    )


def _least(name: str, value: float | None, limit: float) -> Target:
    return Target(
        name=name,
        wanted=f">= {100 * limit:g} %",
        measured="nothing" if value is None else f"{100 * value:.2f} %",
        is_met=None if value is None else value >= limit,
    )


def _limit(name: str, value: float | None, limit: float, unit: str) -> Target:
    return Target(
        name=name,
        wanted=f"<= {limit:g} {unit}",
        measured="nothing" if value is None else f"{value:.3g} {unit}",
        is_met=None if value is None else value <= limit,
    )


def _count(name: str, count: int, whole: int) -> Target:
    return Target(
        name=name,
        wanted="none",
        measured=f"{count} of {whole}" if whole else "nothing",
        is_met=count == 0 if whole else None,
    )
