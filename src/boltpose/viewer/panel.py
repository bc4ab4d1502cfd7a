"""What the panel says: verdict, reasons, scores, timings, bolts. Text in, HTML out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from boltpose.report.advice import ADVICE
from boltpose.report.markup import Html, clip, join, number, percent, tag
from boltpose.report.scores import AT_MOST, Score, missed_although_ok, scores_of
from boltpose.report.verdict import notices
from boltpose.schema import BoltState, Check, LocateResult, Verdict, Visibility
from boltpose.viewer.panel_style import STYLE

_STAGE_COLORS = ("#22508c", "#3f7fc4", "#79aedd", "#d9a441", "#7a9e57", "#9b6fb5", "#888888")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sign:
    """The verdict as it hangs over the picture and on top of the panel."""

    kind: str
    """`ok`, `refused`, `busy` or `wait`: its colour."""
    word: str
    """The largest text of the page."""
    text: str
    scan: str = ""
    """The scan it is about; every verdict names it."""
    points: tuple[str, ...] = ()
    """One line each."""


def sign_of(result: LocateResult, scan_source: str) -> Sign:
    """Sum up a result."""
    scan = PurePath(scan_source).name
    if not result.is_ok:
        failed = sorted(result.verdict.failed, key=list(Check).index)
        return Sign(
            kind="refused",
            word="REFUSED",
            text="No pose is given. The robot must not work on this motor now.",
            scan=scan,
            points=tuple(ADVICE[check].meaning for check in failed),
        )
    missed = missed_although_ok(result.verdict)
    if missed:
        # the file was changed, or two versions do not agree: what it says is no verdict
        names = ", ".join(score.name for score in missed)
        return Sign(
            kind="refused",
            word="DO NOT USE",
            text="It says OK, but scores miss their thresholds. Locate again.",
            scan=scan,
            points=(names,),
        )
    counts = {level: sum(bolt.visibility is level for bolt in result.bolts) for level in Visibility}
    words = zip(("seen", "partly seen", "hidden"), Visibility, strict=True)
    parts = [f"{counts[level]} {word}" for word, level in words if counts[level]]
    forbidden = [bolt.id for bolt in result.bolts if bolt.state is BoltState.CONTRADICTED]
    points = [f"{', '.join(forbidden)}: NOT THERE. No tool must go there."] if forbidden else []
    if result.frame != "base":
        points.append(f"Frame '{result.frame}': NOT robot coordinates.")
    return Sign(
        kind="ok",
        word="OK",
        text=f"{len(result.bolts)} bolts in frame '{result.frame}': {', '.join(parts)}",
        scan=scan,
        points=tuple(points),
    )


def headline(sign: Sign) -> Html:
    """The sign on top of the panel, and the same hung over the picture."""
    about = tag("span", f"scan {clip(sign.scan, 60)}", class_="of") if sign.scan else None
    lines = tag("ul", *(tag("li", text) for text in sign.points)) if sign.points else None
    return join(
        [
            STYLE,
            tag(
                "div",
                tag("b", sign.word),
                tag("span", sign.text),
                lines,
                about,
                class_=f"bpsign {sign.kind}",
                # read aloud once, from the panel
                aria_hidden="true",
            ),
            tag(
                "div",
                tag(
                    "div",
                    tag("b", sign.word),
                    tag("span", sign.text),
                    lines,
                    about,
                    class_=f"verdict {sign.kind}",
                    role="status",
                ),
                class_="bp",
            ),
        ]
    )


def verdict_panel(result: LocateResult, timings_ms: Mapping[str, float]) -> Html:
    """Why and what to do, every score with its threshold, and where the time went."""
    motor = tag("p", "motor ", tag("b", clip(result.prior_name, 60)))
    if result.registration is not None:
        motor = tag(
            "p",
            motor if not result.is_ok else f"motor {clip(result.prior_name, 60)}",
            tag(
                "small", f" probability that the pose is right: {percent(result.verdict.p_correct)}"
            ),
        )
    return box(
        motor,
        *_reasons(result),
        *notices(result),
        _scores(result.verdict),
        _timings(timings_ms),
        _variants(result),
        _origin(result),
    )


def color_legend(entries: Sequence[tuple[str, str]], title: str) -> Html | None:
    """Chips of CSS colours with words."""
    if not entries:
        return None
    return box(
        tag("h3", title),
        *(
            tag("div", tag("span", class_="chip", style=f"background:{color}"), text)
            for color, text in entries
        ),
    )


def _reasons(result: LocateResult) -> list[Html]:
    if result.is_ok:
        return []
    failed = sorted(result.verdict.failed, key=list(Check).index)
    told = [
        tag("div", tag("b", ADVICE[check].meaning), ADVICE[check].todo, class_="reason")
        for check in failed
    ]
    found = tag("p", tag("small", join((f"{reason}." for reason in result.verdict.reasons), " ")))
    candidate = (
        tag(
            "p",
            tag(
                "b",
                "The prior is shown where it was tried: a rejected candidate, for diagnosis only.",
            ),
        )
        if result.registration is not None
        else None
    )
    return [item for item in (*told, found, candidate) if item is not None]


def _scores(verdict: Verdict) -> Html:
    rows = [score for score in scores_of(verdict) if score.threshold is not None]
    return join(
        [
            tag("h3", "Scores ", tag("small", "right of the line is good")),
            tag("table", tag("tbody", *(_score_row(score) for score in rows))),
        ]
    )


def _score_row(score: Score) -> Html:
    sign = "\N{LESS-THAN OR EQUAL TO}" if score.name in AT_MOST else "\N{GREATER-THAN OR EQUAL TO}"
    place = score.goodness
    bar = (
        tag(
            "div",
            tag("u"),
            tag(
                "i",
                style=f"left:{100 * (0.06 + 0.88 * place):.1f}%",
                class_=None if score.is_met else "missed",
            ),
            class_="bar",
        )
        if place is not None
        else tag("small", "not measured")
    )
    value = "\N{EN DASH}" if score.value is None else _plain(score.value)
    wanted = "" if score.threshold is None else f"{sign} {_plain(score.threshold)}"
    return tag(
        "tr",
        tag("td", score.name.replace("_", " ")),
        tag("td", value, class_="n"),
        tag("td", tag("small", wanted), class_="n"),
        tag("td", bar),
        class_="missed" if score.is_met is False else None,
        title="missed" if score.is_met is False else "met",
    )


def _timings(timings_ms: Mapping[str, float]) -> Html | None:
    total = sum(timings_ms.values())
    if not total > 0:
        return None
    colors = {
        stage: _STAGE_COLORS[row % len(_STAGE_COLORS)] for row, stage in enumerate(timings_ms)
    }
    bars = (
        tag(
            "i",
            style=f"width:{100 * value / total:.2f}%;background:{colors[stage]}",
            title=f"{stage} {value:.0f} ms",
        )
        for stage, value in timings_ms.items()
    )
    words = (
        tag(
            "span",
            tag("span", class_="chip", style=f"background:{colors[stage]}"),
            f"{stage} {value:.0f} ms  ",
        )
        for stage, value in timings_ms.items()
    )
    return join(
        [
            tag("h3", f"Time: {total / 1000:.2f} s"),
            tag("div", *bars, class_="stages"),
            tag("p", tag("small", *words)),
        ]
    )


def _variants(result: LocateResult) -> Html | None:
    if not result.variants:
        return None
    rows = (
        tag(
            "tr",
            tag("td", clip(entry.name, 40)),
            tag("td", percent(max(entry.score, 0.0)), class_="n"),
            tag("td", str(entry.status)),
        )
        for entry in result.variants[:6]
    )
    return join(
        [
            tag("h3", "Motors tried ", tag("small", "share of points that agree")),
            tag("table", tag("tbody", *rows)),
        ]
    )


def _origin(result: LocateResult) -> Html:
    provenance = result.provenance
    rows: list[tuple[str, object]] = [("boltpose", str(provenance.get("version", "not noted")))]
    for what in ("scan", "prior", "hand_eye"):
        digest = provenance.get(f"{what}_sha256")
        for one in digest if isinstance(digest, list) else [digest]:
            if isinstance(one, str):
                rows.append((what.replace("_", "-"), tag("code", f"sha256 {one[:12]}", title=one)))
    return join(
        [
            tag("h3", "Where this comes from"),
            tag(
                "table",
                tag("tbody", *(tag("tr", tag("td", name), tag("td", text)) for name, text in rows)),
            ),
        ]
    )


def box(*children: object) -> Html:
    """One piece of the panel, in its style."""
    return tag("div", *children, class_="bp")


def _plain(value: float) -> str:
    digits = 0 if abs(value) >= 100 or value == int(value) else 3 if abs(value) < 1 else 2
    return number(value, digits)
