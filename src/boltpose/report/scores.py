"""Scores against their thresholds: what each means, which side is good, and a bar."""

from __future__ import annotations

import math
from dataclasses import dataclass

from boltpose.report.markup import Html, escape, tag
from boltpose.schema import Verdict

AT_MOST = frozenset({"free_space_violation", "bolt_sigma_mm", "views_apart_sigmas"})
"""Scores that must not exceed their threshold."""
AT_LEAST = frozenset(
    {
        "motor_points",
        "explained",
        "tight",
        "coverage",
        "judged_points",
        "measured",
        "margin",
        "converged",
        "p_correct",
        "variant_lead",
    }
)
"""Scores that must reach their threshold."""
_WORDS = {
    "motor_points": "motor points (2 mm apart)",
    "free_space_violation": "motor surface the camera saw through",
    "explained": "motor points that lie near the prior",
    "tight": "of these, on its surface",
    "weakest_tight": "the same where a shift is felt least",
    "sunk": "scan points inside the motor",
    "coverage": "free surface that was measured",
    "judged_points": "prior points in free view",
    "measured": "free surface with any measurement",
    "margin": "lead over the next best pose",
    "bolt_sigma_mm": "largest 1 sigma of a bolt (mm)",
    "converged": "refinement settled (1 = yes)",
    "p_correct": "probability that the pose is right",
    "variant_lead": "lead over the next motor",
    "views_apart_sigmas": "how far the views disagree (sigma)",
}
_WIDTH, _HEIGHT, _MIDDLE = 100, 12, 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One number of the verdict beside its threshold."""

    name: str
    value: float | None
    """None: it could not be measured."""
    threshold: float | None
    """None: it counts in `p_correct` only."""

    @property
    def is_met(self) -> bool | None:
        """True if the value lies on the good side, None if nobody can say."""
        if self.value is None or self.threshold is None:
            return None
        if self.name in AT_MOST:
            return self.value <= self.threshold
        if self.name in AT_LEAST:
            return self.value >= self.threshold
        return None

    @property
    def goodness(self) -> float | None:
        """Place on a bar from 0 to 1: the threshold is in the middle, good is to the right."""
        if self.value is None or self.threshold is None or self.is_met is None:
            return None
        value, limit = self.value, self.threshold
        if not math.isfinite(value):
            return 1.0 if self.is_met else 0.0
        if self.name in AT_MOST:
            share = 1.0 - value / limit if value <= limit else limit / value - 1.0
        elif value < limit:
            share = max(value, 0.0) / limit - 1.0
        elif limit <= 1:
            share = (value - limit) / (1.0 - limit) if limit < 1 else 1.0
        else:
            # counts: ten times the threshold is as good as it gets
            share = math.log10(value / limit)
        return 0.5 + 0.5 * min(max(share, -1.0), 1.0)


def scores_of(verdict: Verdict) -> list[Score]:
    """Every number behind a verdict, those with a threshold first, in the verdict's order."""
    names = dict.fromkeys([*verdict.thresholds, *verdict.scores])
    return [
        Score(
            name=name,
            value=verdict.scores.get(name),
            threshold=verdict.thresholds.get(name),
        )
        for name in names
    ]


def missed_although_ok(verdict: Verdict) -> list[Score]:
    """Scores on the bad side of an accepted result: the file was changed, or this page is wrong."""
    return [score for score in scores_of(verdict) if score.is_met is False]


def score_section(verdict: Verdict) -> Html:
    """Lay out every score with its threshold and a bar, right of the line is good."""
    scores = scores_of(verdict)
    held = [score for score in scores if score.threshold is not None]
    others = [score for score in scores if score.threshold is None]
    half = (len(held) + 1) // 2
    noted = [f"{_word(score.name)} {_value(score)}" for score in others]
    return tag(
        "section",
        tag("h2", "Scores", tag("small", " right of the line is good")),
        tag(
            "div",
            *(_table(part) for part in (held[:half], held[half:]) if part),
            class_="columns",
        ),
        tag("p", "Without a threshold of their own: ", "; ".join(noted), class_="fine")
        if noted
        else None,
        class_="scores",
    )


def _table(scores: list[Score]) -> Html:
    head = tag(
        "tr",
        tag("th", "score", scope="col"),
        tag("th", "found", scope="col", class_="n"),
        tag("th", "wanted", scope="col", class_="n"),
        tag("th", "bad | good", scope="col", class_="mid"),
    )
    return tag("table", tag("thead", head), tag("tbody", *(_row(score) for score in scores)))


def _row(score: Score) -> Html:
    is_missed = score.is_met is False
    sign = "" if score.threshold is None else _sign(score.name)
    wanted = "" if score.threshold is None else f"{sign}\N{NO-BREAK SPACE}{_plain(score.threshold)}"
    return tag(
        "tr",
        tag("th", _word(score.name), scope="row", title=score.name),
        tag("td", _value(score), class_="n"),
        tag("td", wanted, class_="n"),
        tag("td", _bar(score)),
        class_="missed" if is_missed else None,
    )


def _bar(score: Score) -> Html:
    place = score.goodness
    if place is None:
        return escape("not measured" if score.value is None else "")
    x = round(4 + place * (_WIDTH - 8), 1)
    y = _HEIGHT / 2
    if score.is_met:
        marker = tag("circle", cx=x, cy=y, r=4, fill="#14692f")
    else:
        marker = tag(
            "path",
            d=f"M{x - 4} {y - 4}l8 8m0-8l-8 8",
            stroke="#a80019",
            stroke_width=2.6,
        )
    word = "met" if score.is_met else "missed"
    return tag(
        "svg",
        tag("rect", x=0, y=3, width=_MIDDLE, height=6, fill="#e3e3e3"),
        tag("rect", x=_MIDDLE, y=3, width=_WIDTH - _MIDDLE, height=6, fill="#a9cfb2"),
        tag("rect", x=_MIDDLE - 0.75, y=0, width=1.5, height=_HEIGHT, fill="#111"),
        marker,
        class_="bar",
        viewBox=f"0 0 {_WIDTH} {_HEIGHT}",
        role="img",
        aria_label=word,
    )


def _sign(name: str) -> str:
    if name in AT_MOST:
        return "\N{LESS-THAN OR EQUAL TO}"
    return "\N{GREATER-THAN OR EQUAL TO}" if name in AT_LEAST else ""


def _word(name: str) -> str:
    return _WORDS.get(name, name.replace("_", " "))


def _value(score: Score) -> str:
    return "\N{EN DASH}" if score.value is None else _plain(score.value)


def _plain(value: float) -> str:
    """Four digits at most, no exponent a technician must decode."""
    if not math.isfinite(value):
        return "not finite"
    if value != 0 and abs(value) < 0.0001:
        return (
            "<\N{NO-BREAK SPACE}0.0001" if value > 0 else ">\N{NO-BREAK SPACE}\N{MINUS SIGN}0.0001"
        )
    digits = 0 if abs(value) >= 100 or value == int(value) else 4 if abs(value) < 1 else 2
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
