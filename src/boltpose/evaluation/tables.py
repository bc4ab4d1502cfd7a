"""The tables of `docs/results.md`, each a function from records to Markdown."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from boltpose.evaluation.bolts import BoltError
from boltpose.evaluation.negatives import CaseKind
from boltpose.evaluation.poses import LocatedBoltRecord
from boltpose.evaluation.records import CallTime, MotorRecord, Outcome
from boltpose.evaluation.statistics import Spread, share_of, spread_of
from boltpose.evaluation.targets import Target, accepted_bolts, all_matches, all_views

Row = Sequence[str]


def markdown_table(header: Row, rows: Iterable[Row]) -> str:
    """Lay out a table; a cell's pipes and line breaks are made harmless.

    Raises:
        ValueError: A row has another number of cells than the header.
    """
    lines = [header, ["---"] * len(header), *rows]
    if any(len(line) != len(header) for line in lines):
        raise ValueError(f"every row must have {len(header)} cells")
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def target_table(targets: Sequence[Target]) -> str:
    """Every target, what was wanted and measured, met or not."""
    said = {True: "met", False: "**not met**", None: "not measured"}
    return markdown_table(
        ("what", "target", "measured", ""),
        [(t.name, t.wanted, t.measured, said[t.is_met]) for t in targets],
    )


def prior_table(records: Sequence[MotorRecord]) -> str:
    """Bolts found, motor by motor, and in total."""
    rows: list[Row] = []
    for record in records:
        bolts = record.prior.bolts
        sure = [match for match in bolts.matches if match.is_sure]
        rows.append(
            (
                record.motor,
                record.family,
                str(record.true_bolts),
                str(len(bolts.matches)),
                str(len(bolts.missed)),
                f"{len(bolts.false)} ({sum(b.is_sure for b in bolts.false)} sure)",
                str(sum(not match.is_side_right for match in bolts.matches)),
                str(len(sure)),
                _largest(match.error.lateral_mm for match in sure),
                _largest(m.error.lateral_mm for m in bolts.matches if not m.is_sure),
                _degrees(record.prior.axis_error_rad),
                f"{record.prior.time.wall_s:.1f}",
            )
        )
    return markdown_table(
        (
            "motor",
            "family (not trained on)",
            "bolts",
            "found",
            "missed",
            "false",
            "wrong side",
            "found and sure",
            "worst lateral, sure, mm",
            "worst lateral, unsure, mm",
            "motor axis off, deg",
            "build, s",
        ),
        rows,
    )


def prior_error_table(records: Sequence[MotorRecord]) -> str:
    """Errors of the priors' bolts in frame `prior`, sure and unsure."""
    matches = all_matches(records)
    groups = {
        "sure": [match.error for match in matches if match.is_sure],
        "unsure": [match.error for match in matches if not match.is_sure],
        "all found": [match.error for match in matches],
    }
    return _error_table(groups)


def located_error_table(records: Sequence[MotorRecord]) -> str:
    """Errors of the located bolts in frame `base`, visible and hidden, of views reported ok."""
    bolts = accepted_bolts(records)
    return _error_table({name: [b.error for b in group] for name, group in _groups(bolts).items()})


def sigma_table(records: Sequence[MotorRecord]) -> str:
    """How often the stated 95 % regions hold the truth, and the error per stated sigma."""
    rows: list[Row] = []
    for name, bolts in _groups(accepted_bolts(records)).items():
        rows.append(
            (
                name,
                str(len(bolts)),
                _percent(share_of(bolt.is_position_covered for bolt in bolts)),
                _percent(share_of(bolt.is_lateral_covered for bolt in bolts)),
                _percent(share_of(bolt.is_axial_covered for bolt in bolts)),
                _percent(share_of(bolt.is_axis_covered for bolt in bolts)),
                _median(bolts, lambda b: b.position_sigmas),
                _median(bolts, lambda b: b.error.lateral_mm / b.sigma_lateral_mm),
                _median(bolts, lambda b: abs(b.error.axial_mm) / b.sigma_axial_mm),
                _median(bolts, lambda b: b.error.axis_rad / b.sigma_axis_rad),
            )
        )
    return markdown_table(
        (
            "bolts",
            "count",
            "position held",
            "lateral held",
            "axial held",
            "axis held",
            "position error / covariance, median",
            "lateral error / sigma, median",
            "axial error / sigma, median",
            "axis error / sigma, median",
        ),
        rows,
    )


def visibility_table(records: Sequence[MotorRecord]) -> str:
    """Truly visible or hidden against what the result says."""
    bolts = accepted_bolts(records)
    kinds = sorted({bolt.visibility.value for bolt in bolts})
    rows: list[Row] = []
    for name, flag in (("visible", True), ("hidden", False)):
        of_kind = [bolt for bolt in bolts if bolt.is_truly_visible is flag]
        said = Counter(bolt.visibility.value for bolt in of_kind)
        right = share_of(bolt.is_said_visible is flag for bolt in of_kind)
        gap = spread_of(abs(b.visible_fraction - b.true_visible_fraction) for b in of_kind)
        rows.append(
            (
                name,
                str(len(of_kind)),
                *(str(said[kind]) for kind in kinds),
                _percent(right),
                "" if gap is None else f"{gap.median:.2f} / {gap.p95:.2f}",
            )
        )
    return markdown_table(
        (
            "truly",
            "bolts",
            *(f"said {kind}" for kind in kinds),
            "agree",
            "share of the head off, median / 95 %",
        ),
        rows,
    )


def pose_table(records: Sequence[MotorRecord]) -> str:
    """The rigid pose of the views by clamp: verdicts and the worst bolt of the true model."""
    views = all_views(records)
    rows: list[Row] = []
    for clamp in [*sorted({view.clamp for view in views}), "all"]:
        group = [view for view in views if clamp in ("all", view.clamp)]
        ok = [view for view in group if view.result.is_ok]
        poses = [view.result.pose for view in ok if view.result.pose is not None]
        rows.append(
            (
                clamp,
                str(len(group)),
                str(len(ok)),
                str(sum(view.result.is_wrong_accepted for view in ok)),
                str(sum(view.result.is_scene_good for view in ok)),
                _three(spread_of(pose.worst_bolt_mm for pose in poses), "{:.2f}"),
                _three(spread_of(math.degrees(p.rotation_rad) for p in poses), "{:.3f}"),
            )
        )
    return markdown_table(
        (
            "clamp",
            "views",
            "ok",
            "of these wrong",
            "every bolt within 1 mm and 1 deg",
            "worst bolt of the true model, mm",
            "rotation error, deg",
        ),
        rows,
    )


def refusal_table(records: Sequence[MotorRecord]) -> str:
    """Every refused view with its reason, and whether the candidate pose was right."""
    rows: list[Row] = []
    for record in records:
        for view in record.views:
            result = view.result
            if result.is_ok:
                continue
            candidate = "none"
            if result.pose is not None:
                name = "wrong" if result.pose.is_wrong else "right"
                candidate = f"{name}, worst bolt {result.pose.worst_bolt_mm:.2f} mm"
            rows.append(
                (
                    f"{record.motor}/{view.view}",
                    ", ".join(result.failed),
                    candidate,
                    " ".join(result.reasons),
                )
            )
    if not rows:
        return "No view was refused."
    return markdown_table(("view", "failed checks", "candidate pose", "reasons"), rows)


def negative_table(records: Sequence[MotorRecord]) -> str:
    """The must-be-refused set by kind."""
    rows: list[Row] = []
    for kind in CaseKind:
        cases = [case for record in records for case in record.cases if case.kind is kind]
        if not cases:
            continue
        counts = Counter(case.outcome for case in cases)
        reasons = Counter(name for case in cases for name in case.failed)
        rows.append(
            (
                kind.value,
                cases[0].expectation.value.replace("_", " "),
                str(len(cases)),
                str(counts[Outcome.REFUSED]),
                str(counts[Outcome.RIGHT]),
                f"**{counts[Outcome.WRONG]}**" if counts[Outcome.WRONG] else "0",
                ", ".join(f"{name} {count}" for name, count in reasons.most_common()),
            )
        )
    return markdown_table(
        (
            "scan",
            "allowed",
            "scans",
            "refused",
            "accepted, right",
            "accepted, wrong",
            "failed checks",
        ),
        rows,
    )


def wrong_case_table(records: Sequence[MotorRecord]) -> str:
    """Every scan that was accepted wrongly."""
    rows = [
        (
            record.motor,
            case.kind.value,
            f"{case.scene_motor}/{case.view}",
            ", ".join(f"{name} {value:.3g}" for name, value in sorted(case.scores.items())),
        )
        for record in records
        for case in record.cases
        if case.outcome is Outcome.WRONG
    ]
    if not rows:
        return "None was accepted wrongly."
    return markdown_table(("prior", "scan", "view", "scores"), rows)


def time_table(calls: Sequence[CallTime]) -> str:
    """Wall and CPU seconds per stage over calls, in the order of the first call."""
    names = list(dict.fromkeys(stage.name for call in calls for stage in call.stages))
    rows: list[Row] = []
    for name in names:
        stages = [s for call in calls for s in call.stages if s.name == name]
        rows.append(_time_row(name, [s.wall_s for s in stages], [s.cpu_s for s in stages]))
    rows.append(_time_row("**all**", [c.wall_s for c in calls], [c.cpu_s for c in calls]))
    return markdown_table(("stage", "calls", "wall, s", "CPU, s"), rows)


def _time_row(name: str, wall: Sequence[float], cpu: Sequence[float]) -> Row:
    return (
        name,
        str(len(wall)),
        _three(spread_of(wall), "{:.2f}"),
        _three(spread_of(cpu), "{:.2f}"),
    )


def _groups(bolts: Sequence[LocatedBoltRecord]) -> dict[str, list[LocatedBoltRecord]]:
    """By the truth, not by what the result says."""
    return {
        "visible": [bolt for bolt in bolts if bolt.is_truly_visible],
        "hidden": [bolt for bolt in bolts if not bolt.is_truly_visible],
        "all": list(bolts),
    }


def _error_table(groups: dict[str, list[BoltError]]) -> str:
    return markdown_table(
        (
            "bolts",
            "count",
            "lateral, mm: median / 95 % / max",
            "along the axis, mm: median / 95 % / max",
            "axis, deg: median / 95 % / max",
        ),
        [
            (
                name,
                str(len(errors)),
                _three(spread_of(error.lateral_mm for error in errors), "{:.3f}"),
                _three(spread_of(abs(error.axial_mm) for error in errors), "{:.3f}"),
                _three(spread_of(math.degrees(error.axis_rad) for error in errors), "{:.3f}"),
            )
            for name, errors in groups.items()
        ],
    )


def _three(spread: Spread | None, form: str) -> str:
    if spread is None:
        return ""
    return " / ".join(form.format(v) for v in (spread.median, spread.p95, spread.maximum))


def _median(bolts: Sequence[LocatedBoltRecord], value: Callable[[LocatedBoltRecord], float]) -> str:
    spread = spread_of(value(bolt) for bolt in bolts)
    return "" if spread is None else f"{spread.median:.2f}"


def _largest(values: Iterable[float]) -> str:
    spread = spread_of(values)
    return "" if spread is None else f"{spread.maximum:.2f}"


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f} %"


def _degrees(angle_rad: float | None) -> str:
    return "" if angle_rad is None else f"{math.degrees(angle_rad):.3f}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
