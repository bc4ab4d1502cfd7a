"""What the panel says of bolts: the table, all of one of them, and what their marks mean."""

from __future__ import annotations

import math
from collections.abc import Sequence

from boltpose.arrays import FloatArray
from boltpose.picture.bolt_marks import Ink
from boltpose.report.icons import visibility_icon
from boltpose.report.markup import Html, clip, join, number, percent, tag
from boltpose.schema import BoltState, LocatedBolt, Visibility
from boltpose.viewer.panel import box, color_legend

SEEN_WORDS = {
    Visibility.VISIBLE: "seen",
    Visibility.PARTIAL: "partly seen",
    Visibility.HIDDEN: "hidden: from the prior",
}


def bolt_table(bolts: Sequence[LocatedBolt]) -> Html:
    """One row per bolt, in the order they are taken out."""
    if not bolts:
        return box(tag("p", "No bolts: no pose is given."))
    ordered = sorted(bolts, key=lambda bolt: math.inf if bolt.order is None else bolt.order)
    head = ("bolt", "camera", "x", "y", "z", "\N{PLUS-MINUS SIGN}")
    return box(
        tag(
            "table",
            tag(
                "thead",
                tag(
                    "tr",
                    *(tag("th", text, class_="n" if len(text) == 1 else None) for text in head),
                ),
            ),
            tag("tbody", *(_bolt_row(bolt) for bolt in ordered)),
        ),
        tag(
            "p",
            tag(
                "small",
                "mm, middle of the head's top face; \N{PLUS-MINUS SIGN} 1 sigma beside the"
                " axis. Click a bolt in the picture or choose one below.",
            ),
        ),
    )


def bolt_detail(bolt: LocatedBolt | None, frame: str) -> Html:
    """All that is known of the bolt that was chosen."""
    if bolt is None:
        return box(tag("p", tag("small", "No bolt is chosen.")))
    is_forbidden = bolt.state is BoltState.CONTRADICTED
    rows: list[tuple[str, object]] = [
        (
            "camera",
            join(
                [
                    visibility_icon(bolt.visibility),
                    f" {SEEN_WORDS[bolt.visibility]}, {percent(bolt.visible_fraction)} of the head",
                ]
            ),
        ),
        (
            "state",
            {
                "confirmed": "confirmed by the camera",
                "unseen": "not checked by the camera",
                "contradicted": "CONTRADICTED",
            }[str(bolt.state)],
        ),
        (f"head top in {frame}", _three(bolt.head_top, 2) + " mm"),
        ("axis, out of the head", _three(bolt.axis, 4)),
        (
            "1 sigma beside / along",
            f"{number(bolt.sigma_lateral_mm, 2)} / {number(bolt.sigma_axial_mm, 2)} mm",
        ),
        ("1 sigma of the axis", f"{number(math.degrees(bolt.sigma_axis_rad), 2)}\N{DEGREE SIGN}"),
        (
            "head",
            f"{number(bolt.head_diameter_mm, 1)} mm wide, {number(bolt.head_height_mm, 1)} mm high",
        ),
        (
            "in the prior",
            f"{bolt.side} side, {'sure' if bolt.is_sure else 'NOT sure'} "
            f"({percent(bolt.confidence)})",
        ),
    ]
    if bolt.tool:
        rows.append(("tool", clip(bolt.tool, 60)))
    if bolt.order is not None:
        rows.append(("turn", bolt.order))
    if bolt.p_tool_fits is not None:
        rows.append(("tool lands", percent(bolt.p_tool_fits)))
    for remark in bolt.remarks:
        rows.append(("remark", remark))
    title = bolt.id if not bolt.name else f"{bolt.id}  {clip(bolt.name, 60)}"
    return box(
        tag("h3", title),
        tag(
            "p",
            tag("b", "No tool must go there. "),
            bolt.state_reason,
            class_="error",
        )
        if is_forbidden
        else None,
        tag(
            "table",
            tag("tbody", *(tag("tr", tag("td", name), tag("td", text)) for name, text in rows)),
            data_bolt=bolt.id,
        ),
    )


def mark_legend(inks: Sequence[Ink]) -> Html | None:
    """What the marks of bolts mean."""
    if not inks:
        return None
    shapes = {
        Ink.SEEN: "full head, full arrow",
        Ink.PARTIAL: "ring, full arrow",
        Ink.HIDDEN: "ring, dashed arrow",
        Ink.FORBIDDEN: "black cross, no arrow",
    }
    return color_legend([(ink.color, f"{shapes[ink]}: {ink.label}") for ink in inks], "Bolts")


def _bolt_row(bolt: LocatedBolt) -> Html:
    is_forbidden = bolt.state is BoltState.CONTRADICTED

    def figure(text: str) -> Html:
        return tag("td", tag("s", text) if is_forbidden else text, class_="n")

    turn = "" if bolt.order is None else f"{bolt.order}. "
    name = f" {clip(bolt.name, 24)}" if bolt.name else ""
    unsure = "" if bolt.is_sure else " ?"
    seen = "NOT THERE" if is_forbidden else SEEN_WORDS[bolt.visibility].split(":")[0]
    return tag(
        "tr",
        tag("td", turn, tag("b", bolt.id), f"{unsure}{name}"),
        tag("td", visibility_icon(bolt.visibility), f" {seen}"),
        *(figure(number(float(value), 1)) for value in bolt.head_top),
        figure(number(bolt.sigma_lateral_mm, 2)),
        class_="forbidden" if is_forbidden else None,
    )


def _three(values: FloatArray, digits: int) -> str:
    return "  ".join(number(float(value), digits) for value in values)
