"""The key to the marks of bolts, each with a small drawing of it."""

from __future__ import annotations

from collections.abc import Sequence

from boltpose.picture.bolt_marks import BoltMark, Ink
from boltpose.report.markup import Html, join, tag

_DASHED = {"stroke": "#111", "stroke_width": 1.6, "stroke_dasharray": "3 1.5"}


def mark_key(marks: Sequence[BoltMark], *, has_extra: bool) -> Html | None:
    """The marks in use, each with a small drawing of it."""
    inks = [ink for ink in Ink if any(mark.ink is ink for mark in marks)]
    entries = [
        tag("span", _key_sign(ink), f" {ink.label.split(':', maxsplit=1)[0]}", class_="key")
        for ink in inks
    ]
    if has_extra:
        sign = tag("rect", x=7, y=1, width=10, height=10, fill="none", **_DASHED)
        entries.append(
            tag(
                "span",
                tag("svg", sign, viewBox="0 0 26 12", class_="sign", aria_hidden="true"),
                " perhaps a bolt",
                class_="key",
            )
        )
    return join(entries) if entries else None


def _key_sign(ink: Ink) -> Html:
    if ink is Ink.FORBIDDEN:
        shape = tag("path", d="M8 1l10 10m0-10l-10 10", stroke=ink.color, stroke_width=3)
    else:
        shape = join(
            [
                tag(
                    "path",
                    d="M1 6h17",
                    stroke=ink.color,
                    stroke_width=2.4,
                    stroke_dasharray="4 2" if ink is Ink.HIDDEN else None,
                ),
                tag(
                    "path",
                    d="M16 1.5l9 4.5l-9 4.5z",
                    stroke=ink.color,
                    stroke_width=1.5,
                    fill=ink.color if ink.is_solid else "#fff",
                ),
            ]
        )
    return tag("svg", shape, viewBox="0 0 26 12", class_="sign", aria_hidden="true")
