"""The table of bolts: where each is, how well that is known, and which must not be touched."""

from __future__ import annotations

import math
from collections.abc import Sequence

from boltpose.report.icons import cross_icon, visibility_icon
from boltpose.report.markup import Html, clip, join, number, percent, tag
from boltpose.schema import BoltState, LocatedBolt, LocateResult, Visibility

SEEN_WORDS = {
    Visibility.VISIBLE: "seen",
    Visibility.PARTIAL: "partly seen",
    Visibility.HIDDEN: "hidden",
}
_STATE_WORDS = {BoltState.CONFIRMED: "confirmed", BoltState.UNSEEN: "unseen"}
_NAME_LENGTH, _TOOL_LENGTH = 30, 14
"""Longer ones are cut in the table; pointing at the cell shows all of it."""


def in_order(bolts: Sequence[LocatedBolt]) -> list[LocatedBolt]:
    """Sort bolts by their turn; those without one last, in the order of the result."""
    return sorted(bolts, key=lambda bolt: math.inf if bolt.order is None else bolt.order)


def contradicted(bolts: Sequence[LocatedBolt]) -> list[LocatedBolt]:
    """Bolts that no tool must go to."""
    return [bolt for bolt in bolts if bolt.state is BoltState.CONTRADICTED]


def has_notes(bolt: LocatedBolt) -> bool:
    """Tell whether a bolt takes a second line."""
    return _notes(bolt) is not None


def bolt_section(result: LocateResult) -> Html | None:
    """Lay out one row per bolt, and a second one under bolts that have remarks."""
    if not result.bolts:
        return None
    bolts = in_order(result.bolts)
    columns = _Columns(bolts)
    return tag(
        "section",
        tag(
            "h2",
            f"Bolts in frame \N{LEFT SINGLE QUOTATION MARK}{result.frame}"
            "\N{RIGHT SINGLE QUOTATION MARK}",
            None if result.frame == "base" else tag("em", ": NOT ROBOT COORDINATES"),
            tag(
                "small",
                " mm; middle of the head's top face, axis out of the head; sigma: beside / along"
                " the axis, and of its direction",
            ),
        ),
        tag(
            "table",
            tag("thead", columns.head()),
            *(columns.body(bolt) for bolt in bolts),
            class_="bolts",
        ),
    )


class _Columns:
    """Which columns this motor's bolts need."""

    def __init__(self, bolts: Sequence[LocatedBolt]) -> None:
        self._has_order = any(bolt.order is not None for bolt in bolts)
        self._has_tool = any(bolt.tool for bolt in bolts)
        self._has_fit = any(bolt.p_tool_fits is not None for bolt in bolts)
        self._count = 8 + self._has_order + self._has_tool + self._has_fit

    def head(self) -> Html:
        return tag(
            "tr",
            _header("turn") if self._has_order else None,
            _header("bolt"),
            _header("tool") if self._has_tool else None,
            _header("camera"),
            _header("state"),
            *(_header(name, "n") for name in ("x", "y", "z", "axis x y z")),
            _header("sigma", "n"),
            _header("tool fits", "n") if self._has_fit else None,
        )

    def body(self, bolt: LocatedBolt) -> Html:
        is_forbidden = bolt.state is BoltState.CONTRADICTED
        notes = _notes(bolt)
        classes = " ".join(
            word
            for word, holds in (("forbidden", is_forbidden), ("unsure", not bolt.is_sure))
            if holds
        )
        remark = tag("td", notes, colspan=self._count, class_="note") if notes else None
        # a group of its own per bolt: a page never ends between a bolt and its remarks
        return tag(
            "tbody",
            tag("tr", *self._cells(bolt, is_forbidden=is_forbidden)),
            None if remark is None else tag("tr", remark),
            class_=classes or None,
        )

    def _cells(self, bolt: LocatedBolt, *, is_forbidden: bool) -> list[Html | None]:
        def figure(text: str) -> Html:
            # crossed out by the element too: a copy without our style still shows it
            return tag("td", tag("s", text) if is_forbidden else text, class_="n")

        seen = join(
            [visibility_icon(bolt.visibility), f" {SEEN_WORDS[bolt.visibility]} "]
            + ([percent(bolt.visible_fraction)] if bolt.visible_fraction > 0 else [])
        )
        axis = " ".join(number(float(value), 3) for value in bolt.axis)
        fits = "\N{EN DASH}" if bolt.p_tool_fits is None else percent(bolt.p_tool_fits)
        return [
            tag("td", "" if bolt.order is None else bolt.order) if self._has_order else None,
            _name_cell(bolt),
            tag("td", clip(bolt.tool, _TOOL_LENGTH), title=bolt.tool or None, class_="word")
            if self._has_tool
            else None,
            tag("td", seen, class_="word"),
            tag("td", _state(bolt), class_="word"),
            *(figure(number(float(value), 2)) for value in bolt.head_top),
            figure(axis),
            figure(_sigma(bolt)),
            figure(fits) if self._has_fit else None,
        ]


def _header(text: str, class_: str | None = None) -> Html:
    return tag("th", text, scope="col", class_=class_)


def _name_cell(bolt: LocatedBolt) -> Html:
    name = bolt.name if bolt.name and bolt.name != bolt.id else ""
    return tag(
        "th",
        tag("b", clip(bolt.id, 12)),
        f" {clip(name, _NAME_LENGTH)}" if name else None,
        scope="row",
        title=f"{bolt.id} {name}".strip(),
    )


def _state(bolt: LocatedBolt) -> Html:
    if bolt.state is BoltState.CONTRADICTED:
        return join([cross_icon(), tag("strong", " DO NOT TOUCH")])
    return join([_STATE_WORDS[bolt.state], None if bolt.is_sure else tag("strong", " look!")])


def _sigma(bolt: LocatedBolt) -> str:
    beside, along = number(bolt.sigma_lateral_mm, 2), number(bolt.sigma_axial_mm, 2)
    return f"{beside} / {along}, {number(math.degrees(bolt.sigma_axis_rad), 2)}\N{DEGREE SIGN}"


def _notes(bolt: LocatedBolt) -> Html | None:
    lines: list[Html] = []
    if bolt.state is BoltState.CONTRADICTED:
        lines.append(
            join(
                [
                    tag("strong", "No tool must go here. "),
                    f"The camera saw something else: {bolt.state_reason or 'no reason given'}.",
                ]
            )
        )
    if not bolt.is_sure:
        lines.append(
            join(
                [
                    tag("strong", "Not sure in the prior "),
                    f"({percent(bolt.confidence)}): a person should look at it once.",
                ]
            )
        )
    if bolt.remarks:
        lines.append(join([f"Prior: {'; '.join(bolt.remarks)}."]))
    return join(lines, " ") if lines else None
