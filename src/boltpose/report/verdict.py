"""The top of the page: what a person must know in five seconds, and what to do."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath

from boltpose.report.advice import ADVICE
from boltpose.report.bolts import SEEN_WORDS, contradicted
from boltpose.report.icons import verdict_icon, warning_icon
from boltpose.report.markup import Html, clip, join, number, percent, tag
from boltpose.report.scores import missed_although_ok
from boltpose.schema import Check, LocatedBolt, LocateResult, Visibility

_ORDER = list(Check)
"""What to look at first."""


def banner(result: LocateResult, scan_source: str) -> Html:
    """The verdict in one word, what it covers, and which scan and motor it is about."""
    word = join(["OK"]) if result.is_ok else join(["REFUSED"])
    if result.is_ok and result.frame != "base":
        word = join([word, tag("small", f" in the {result.frame}'s frame only")])
    views = result.provenance.get("views")
    count = len(views) if isinstance(views, list | tuple) else 1
    shown = PurePath(scan_source).name or scan_source
    facts = [
        ("Motor", result.prior_name),
        ("Scan", shown if count <= 1 else f"{shown}, one of {count} views"),
    ]
    if result.registration is not None:
        facts.append(("Pose is right", percent(result.verdict.p_correct)))
    return tag(
        "header",
        verdict_icon(is_ok=result.is_ok),
        tag("div", tag("h1", word), tag("p", _summary(result)), class_="word"),
        tag(
            "dl",
            *(
                tag("div", tag("dt", name), tag("dd", clip(text, 48), title=text))
                for name, text in facts
            ),
        ),
        class_=f"verdict {'ok' if result.is_ok else 'refused'}",
    )


def notices(result: LocateResult) -> list[Html]:
    """Everything that a person must not miss beside the verdict, the most dangerous first."""
    found: list[Html] = []
    wrong = missed_although_ok(result.verdict) if result.is_ok else []
    if wrong:
        names = ", ".join(score.name for score in wrong)
        found.append(
            _notice(
                "DO NOT USE THIS RESULT.",
                f"It says OK, but these scores miss their thresholds: {names}. The file was"
                " changed, or two versions do not agree. Locate again.",
                is_danger=True,
            )
        )
    if result.frame != "base" and (result.bolts or result.extra_heads):
        found.append(
            _notice(
                "NOT ROBOT COORDINATES.",
                f"All positions are in the frame of the {result.frame}. Never send them to a robot."
                " Locate again with the hand-eye file: ",
                tag("code", "--hand-eye FILE"),
                is_danger=True,
            )
        )
    forbidden = contradicted(result.bolts)
    if forbidden:
        names = _names(forbidden)
        found.append(
            _notice(
                f"DO NOT TOUCH {names}.",
                "The camera saw something else in the place of"
                f" {'this bolt' if len(forbidden) == 1 else 'these bolts'}."
                " Look at the motor before any tool goes near.",
            )
        )
    unsure = [bolt for bolt in result.bolts if not bolt.is_sure]
    if unsure:
        names = _names(unsure)
        found.append(
            _notice(
                f"LOOK ONCE AT {names}.",
                "The prior is not sure here. A person checks it once per type of motor: ",
                tag("code", "boltpose prior review"),
            )
        )
    if result.extra_heads:
        places = "; ".join(
            f"{number(head.diameter_mm, 0)} mm wide at "
            + ", ".join(number(float(value), 1) for value in head.head_top_mm)
            for head in result.extra_heads[:4]
        )
        more = len(result.extra_heads) - 4
        found.append(
            _notice(
                "PERHAPS A BOLT THAT THE PRIOR LACKS:",
                f"{places}{f'; and {more} more' if more > 0 else ''} (frame {result.frame}, mm)."
                " Often it is a screw of the clamp. If not, add it to the prior.",
            )
        )
    return found


def refusal_section(result: LocateResult) -> Html | None:
    """Why no pose is given, and what to do about every reason."""
    if result.is_ok:
        return None
    failed = sorted(result.verdict.failed, key=_ORDER.index)
    rows = [
        tag(
            "tr",
            tag("th", ADVICE[check].meaning, tag("code", str(check)), scope="row"),
            tag("td", ADVICE[check].todo),
            class_="first" if row == 0 else None,
        )
        for row, check in enumerate(failed)
    ]
    return tag(
        "section",
        tag(
            "h2",
            "Why, and what to do",
            tag("small", " start with the first"),
        ),
        tag(
            "table",
            tag(
                "thead",
                tag("tr", tag("th", "reason", scope="col"), tag("th", "what to do", scope="col")),
            ),
            tag("tbody", *rows),
            class_="advice",
        ),
        tag("h3", "What was measured"),
        tag(
            "ul",
            *(tag("li", f"{reason.rstrip('.')}.") for reason in result.verdict.reasons),
            class_="found",
        ),
        class_="refusal",
    )


def _summary(result: LocateResult) -> Html:
    if not result.is_ok:
        return join(
            [tag("strong", "No pose is given. "), "The robot must not work on this motor now."]
        )
    counts = {level: sum(bolt.visibility is level for bolt in result.bolts) for level in Visibility}
    seen = _listed(f"{counts[level]} {SEEN_WORDS[level]}" for level in Visibility if counts[level])
    usable = len(result.bolts) - len(contradicted(result.bolts))
    lead = (
        f"{len(result.bolts)} bolts"
        if usable == len(result.bolts)
        else f"{usable} of {len(result.bolts)} bolts may be used"
    )
    where = f" in frame {result.frame}"
    return join([tag("strong", lead + where), f": {seen}." if seen else "."])


def _listed(parts: Iterable[str]) -> str:
    return ", ".join(parts)


def _names(bolts: Sequence[LocatedBolt]) -> str:
    """Ids, as in the table and the pictures; one alone with its name."""
    if len(bolts) == 1 and bolts[0].name not in ("", bolts[0].id):
        return f"{clip(bolts[0].id, 12)} ({clip(bolts[0].name, 36)})"
    return ", ".join(clip(bolt.id, 12) for bolt in bolts)


def _notice(lead: str, *text: object, is_danger: bool = False) -> Html:
    return tag(
        "p",
        warning_icon(),
        tag("span", tag("strong", lead), " ", *text),
        class_="notice danger" if is_danger else "notice",
        role="note",
    )
