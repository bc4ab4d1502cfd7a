"""Results as a person reads them in a terminal."""

from __future__ import annotations

import math

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from boltpose.arrays import FloatArray
from boltpose.prior.review_notes import PastReview, past_reviews
from boltpose.schema import (
    BoltState,
    LocatedBolt,
    LocateResult,
    Prior,
    PriorBolt,
    Verdict,
    Visibility,
)

_VISIBILITY_STYLE = {
    Visibility.VISIBLE: "green",
    Visibility.PARTIAL: "yellow",
    Visibility.HIDDEN: "dark_orange",
}
_STATE_MARK = {
    BoltState.CONFIRMED: Text("+", style="green"),
    BoltState.UNSEEN: Text(" "),
    BoltState.CONTRADICTED: Text("!", style="bold red"),
}
"""Behind what was seen of a bolt; the contradicted ones are named above the table."""


def describe_result(result: LocateResult) -> RenderableType:
    """Lay out a result: the verdict with its numbers on top, then one row per bolt."""
    parts: list[RenderableType] = [_verdict_panel(result), _score_table(result.verdict)]
    if result.bolts:
        parts.append(_bolt_table(result))
    parts += [_words(bolt) for bolt in result.bolts if _has_words(bolt)]
    parts += [_remarks(bolt.id, bolt.remarks) for bolt in result.bolts if bolt.remarks]
    return Group(*parts)


def describe_prior(prior: Prior) -> RenderableType:
    """Lay out a prior: its alignment and one row per bolt."""
    alignment = prior.alignment
    roll = "from the solenoid" if alignment.has_solenoid else "free: no solenoid found"
    lines = [
        Text(f"{len(prior.bolts)} bolts, {len(prior.points)} points", style="bold"),
        Text(
            f"axis from {alignment.normal_count} housing normals, "
            f"spread {math.degrees(alignment.axis_spread_rad):.2f} deg, "
            f"sigma {math.degrees(alignment.axis_sigma_rad):.3f} deg; roll {roll}"
        ),
    ]
    lines += _to_look_at(prior)
    lines += [Text(_review_line(review), style="dim") for review in past_reviews(prior)]
    panel = Panel(Group(*lines), title=_prior_title(prior.name), title_align="left", expand=False)
    # why a bolt is unsure stands in the panel
    remarks = [
        _remarks(bolt.id, bolt.remarks) for bolt in prior.bolts if bolt.is_sure and bolt.remarks
    ]
    words = [_words(bolt) for bolt in prior.bolts if _has_words(bolt)]
    return Group(panel, _prior_bolt_table(prior), *words, *remarks)


def _review_line(review: PastReview) -> str:
    noun = "edit" if review.edit_count == 1 else "edits"
    who = f" by {review.by}" if review.by else ""
    when = f", {review.date}" if review.date else ""
    return f"reviewed{who}{when}: {review.edit_count} {noun}"


def _to_look_at(prior: Prior) -> list[Text]:
    """Name the bolts a person should look at, the most doubtful first, and why."""
    unsure = sorted(
        (bolt for bolt in prior.bolts if not bolt.is_sure), key=lambda bolt: bolt.confidence
    )
    if not unsure:
        return [Text("every bolt is sure", style="green")]
    noun = "bolt" if len(unsure) == 1 else "bolts"
    head = (
        f"look at {len(unsure)} {noun}, then keep, confirm or remove with `boltpose prior review`:"
    )
    rows = [
        Text(f"  {bolt.id}: confidence {bolt.confidence:.0%}: {'; '.join(bolt.remarks)}")
        for bolt in unsure
    ]
    return [Text(head, style="yellow"), *rows]


def _verdict_panel(result: LocateResult) -> Panel:
    if result.is_ok:
        counts = {
            level: sum(bolt.visibility is level for bolt in result.bolts) for level in Visibility
        }
        seen = ", ".join(f"{count} {level}" for level, count in counts.items())
        body = [Text(f"OK: {len(result.bolts)} bolts in frame '{result.frame}' ({seen})")]
        body[0].stylize("bold green")
        unsure = [bolt.id for bolt in result.bolts if not bolt.is_sure]
        if unsure:
            body.append(Text(f"unsure in the prior: {', '.join(unsure)}", style="yellow"))
        body += [
            Text(f"CONTRADICTED, no tool there: {bolt.id}: {bolt.state_reason}", style="bold red")
            for bolt in result.bolts
            if bolt.state is BoltState.CONTRADICTED
        ]
        body += [
            Text(
                f"perhaps a bolt that the prior lacks, {head.diameter_mm:.0f} mm wide, at "
                f"{_numbers(head.head_top_mm, '.1f')}",
                style="yellow",
            )
            for head in result.extra_heads
        ]
    else:
        codes = ", ".join(str(check) for check in result.verdict.failed)
        body = [Text(f"REFUSED, no pose is given: {codes}", style="bold red")]
        body += [Text(f"- {reason}") for reason in result.verdict.reasons]
    if result.variants:
        tried = ", ".join(f"{entry.name} {max(entry.score, 0.0):.2f}" for entry in result.variants)
        body.append(Text(f"agreement of the motors compared: {tried}"))
    style = "green" if result.is_ok else "red"
    title = _prior_title(result.prior_name)
    return Panel(Group(*body), title=title, title_align="left", border_style=style, expand=False)


def _prior_title(name: str) -> Text:
    # no plain string: rich would take a name's [brackets] for markup
    return Text(f"prior '{name}'")


def _score_table(verdict: Verdict) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("score")
    table.add_column("value", justify="right")
    table.add_column("threshold", justify="right")
    # a score that could not be measured still has its threshold, and the reasons tell why
    for name in dict.fromkeys([*verdict.scores, *verdict.thresholds]):
        value, limit = verdict.scores.get(name), verdict.thresholds.get(name)
        table.add_row(
            name.replace("_", " "),
            "-" if value is None else f"{value:.4g}",
            "" if limit is None else f"{limit:.4g}",
        )
    return table


def _bolt_table(result: LocateResult) -> Table:
    table = _table(
        f"head_top and outward axis in frame '{result.frame}', mm; sigma beside/along and of axis"
    )
    table.add_column("id", no_wrap=True)
    table.add_column("side", no_wrap=True)
    for name in ("head_top", "axis", "seen", "sigma\nmm", "sigma\ndeg"):
        table.add_column(name, justify="right", no_wrap=True)
    has_tool = any(bolt.p_tool_fits is not None for bolt in result.bolts)
    if has_tool:
        table.add_column("fits", justify="right", no_wrap=True)
    table.add_column("sure", no_wrap=True)
    for bolt in result.bolts:
        table.add_row(*_bolt_row(bolt, has_tool=has_tool))
    return table


def _bolt_row(bolt: LocatedBolt, *, has_tool: bool) -> tuple[str | Text, ...]:
    seen = Text(f"{bolt.visibility} {math.floor(100 * bolt.visible_fraction):3d}%")
    seen.stylize(_VISIBILITY_STYLE[bolt.visibility])
    seen.append_text(_STATE_MARK[bolt.state])
    tool = "" if bolt.p_tool_fits is None else f"{math.floor(100 * bolt.p_tool_fits)}%"
    return (
        bolt.id,
        str(bolt.side),
        _numbers(bolt.head_top, "8.2f"),
        _numbers(bolt.axis, "6.3f"),
        seen,
        f"{bolt.sigma_lateral_mm:.2f}/{bolt.sigma_axial_mm:.2f}",
        f"{math.degrees(bolt.sigma_axis_rad):.2f}",
        *((tool,) if has_tool else ()),
        _sure(bolt.is_sure),
    )


def _prior_bolt_table(prior: Prior) -> Table:
    table = _table("head_top and outward axis in frame 'prior', mm")
    for name in ("id", "side"):
        table.add_column(name, no_wrap=True)
    for name in ("head_top", "axis", "head", "points", "class", "fit", "conf"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("sure", no_wrap=True)
    for bolt in prior.bolts:
        table.add_row(*_prior_bolt_row(bolt))
    return table


def _prior_bolt_row(bolt: PriorBolt) -> tuple[str | Text, ...]:
    return (
        bolt.id,
        str(bolt.side),
        _numbers(bolt.prior_from_bolt.translation_mm, "8.2f"),
        _numbers(bolt.prior_from_bolt.z_axis, "6.3f"),
        f"{bolt.head_diameter_mm:.1f}",
        str(bolt.point_count),
        f"{bolt.class_probability:.0%}",
        f"{bolt.head_fit_support:.0f}",
        f"{bolt.confidence:.0%}",
        _sure(bolt.is_sure),
    )


def _table(title: str) -> Table:
    return Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
        title=title,
        title_justify="left",
        title_style="bold",
    )


def _numbers(values: FloatArray, form: str) -> str:
    # + 0.0 turns a rounded -0.000 into 0.000
    return " ".join(f"{round(float(value), 4) + 0.0:{form}}" for value in values)


def _sure(is_sure: bool) -> Text:
    return Text("yes") if is_sure else Text("NO", style="bold yellow")


def _has_words(bolt: LocatedBolt | PriorBolt) -> bool:
    return bool(bolt.name or bolt.tool or bolt.order is not None)


def _words(bolt: LocatedBolt | PriorBolt) -> Text:
    """What a person has said of a bolt in the prior's review."""
    turn = "" if bolt.order is None else f"turn {bolt.order}"
    return Text(f"{bolt.id}: " + ", ".join(part for part in (bolt.name, bolt.tool, turn) if part))


def _remarks(bolt_id: str, remarks: tuple[str, ...]) -> Text:
    return Text(f"{bolt_id}: {'; '.join(remarks)}", style="yellow")
