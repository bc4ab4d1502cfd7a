"""Marks over a picture as SVG: sharp in print, readable without colours, and text that is text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.picture.bolt_marks import (
    BoltMark,
    Ink,
    arrow_ends,
    head_ring,
    place_names,
    scale_bar_mm,
)
from boltpose.picture.view import View
from boltpose.report.markup import Html, clip, join, tag

_SHORT_PX = 7.0
"""An arrow seen so nearly end on is drawn as a dot."""
_TRIAD_PX = 30.0


def bolt_marks(view: View, marks: Sequence[BoltMark]) -> Html:
    """A ring around every head, an arrow along every axis, names beside; crosses on forbidden."""
    ends = [arrow_ends(view, mark) for mark in marks]
    for mark, shaft in zip(marks, ends, strict=True):
        if mark.ink is Ink.FORBIDDEN:
            shaft[1] = shaft[0]
    drawn = [
        _cross(view, mark) if mark.ink is Ink.FORBIDDEN else _target(view, mark, shaft)
        for mark, shaft in zip(marks, ends, strict=True)
    ]
    places = place_names(np.array(ends).reshape(-1, 2, 2), view)
    names = [_name(mark, place) for mark, place in zip(marks, places, strict=True)]
    return join([*drawn, *names])


def extra_marks(view: View, places: FloatArray) -> Html:
    """A dashed square with a question mark at what may be a bolt; `places` as `View.project`."""
    parts: list[Html] = []
    for x, y, _ in places:
        square = {"x": _px(x - 9), "y": _px(y - 9), "width": 18, "height": 18}
        parts += [
            tag("rect", **square, **_line("#fff", 5)),
            tag("rect", stroke_dasharray="3 2", **square, **_line("#111", 2)),
            label("?", x, y + 5, anchor="middle"),
        ]
    return join(parts)


def scale_bar(view: View) -> Html:
    """A bar of a round length, true at the subject's distance."""
    length_mm = scale_bar_mm(view)
    length = round(length_mm * view.pixels_per_mm, 1)
    x, y = 12, view.height - 12
    return join(
        [
            tag("path", d=f"M{x} {y}h{length}", stroke="#fff", stroke_width=7),
            tag("path", d=f"M{x} {y}h{length}", stroke="#111", stroke_width=4),
            label(f"{length_mm} mm", x + length / 2, y - 7, anchor="middle"),
        ]
    )


def triad(view: View, view_from_frame: FloatArray, frame: str) -> Html:
    """The axes of a frame in the lower right corner.

    Args:
        view: The picture.
        view_from_frame: Shape (3, 3), its columns are the frame's axes in `view`.
        frame: Its name.
    """
    origin = np.array([view.width - 56.0, view.height - 68.0])
    parts: list[Html] = []
    # the axis that points away from the viewer first: the others are drawn over it
    for column in np.argsort(-view_from_frame[2]):
        x, y = view_from_frame[0, column], view_from_frame[1, column]
        tip = origin + _TRIAD_PX * np.array([x, y])
        name = "xyz"[int(column)]
        if np.hypot(x, y) < 0.25:
            # towards the viewer a dot in a ring, away from him a cross in a ring
            towards = view_from_frame[2, column] < 0
            parts += [
                _dot(origin, 6, fill="#fff", stroke="#111", stroke_width=1.6),
                _dot(origin, 2.2, fill="#111")
                if towards
                else tag("path", d=_saltire(origin, 4), **_line("#111", 1.6)),
                label(name, origin[0] - 13, origin[1] + 14, anchor="middle"),
            ]
            continue
        beyond = origin + (_TRIAD_PX + 11) * np.array([x, y]) / max(np.hypot(x, y), 0.5)
        parts += [
            tag("path", d=_polyline(np.array([origin, tip])), **_line("#fff", 5)),
            tag("path", d=_polyline(np.array([origin, tip])), **_line("#111", 2.2)),
            label(name, beyond[0], beyond[1] + 5, anchor="middle"),
        ]
    parts.append(label(frame, origin[0], view.height - 5, anchor="middle"))
    return join(parts)


def ribbon(view: View, text: str) -> Html:
    """A red band with words across the top of a picture that must not be followed."""
    return join(
        [
            tag("rect", x=0, y=0, width=view.width, height=30, fill="#a80019"),
            tag(
                "text",
                text,
                x=_px(view.width / 2),
                y=21,
                text_anchor="middle",
                class_="ribbon",
            ),
        ]
    )


def label(text: str, x: float, y: float, *, anchor: str = "start") -> Html:
    """Text with a white rim, so that it reads on any ground."""
    return tag(
        "text",
        text,
        x=_px(x),
        y=_px(y),
        text_anchor=anchor,
        class_="label",
    )


def _target(view: View, mark: BoltMark, shaft: FloatArray) -> Html:
    ink = mark.ink
    dashes = "4.5 2.5" if ink is Ink.HIDDEN else None
    ring = _polyline(head_ring(view, mark)[:-1]) + "z"
    tail, tip = shaft
    length = float(np.linalg.norm(tip - tail))
    parts = [
        tag("path", d=ring, **_line("#fff", 4.5)),
        tag(
            "path",
            d=ring,
            fill=ink.color if ink.is_solid else "none",
            fill_opacity="0.35",
            stroke=ink.color,
            stroke_width=2.2,
            stroke_dasharray=dashes,
        ),
    ]
    if length < _SHORT_PX:
        fill = ink.color if ink.is_solid else "#fff"
        parts.append(_dot(tail, 3.6, fill=fill, stroke=ink.color, stroke_width=2))
        return join(parts)
    heading = (tip - tail) / length
    beside = np.array([-heading[1], heading[0]])
    neck = tip - 10 * heading
    head = _polyline(np.array([tip, neck + 5 * beside, neck - 5 * beside])) + "z"
    shank = _polyline(np.array([tail, neck]))
    parts += [
        tag("path", d=_polyline(np.array([tail, tip])), **_line("#fff", 6)),
        tag("path", d=shank, stroke_dasharray=dashes, **_line(ink.color, 2.8)),
        tag(
            "path",
            d=head,
            fill=ink.color if ink.is_solid else "#fff",
            stroke=ink.color,
            stroke_width=1.8,
            stroke_linejoin="round",
        ),
    ]
    return join(parts)


def _cross(view: View, mark: BoltMark) -> Html:
    ring = head_ring(view, mark)[:-1]
    middle = ring.mean(axis=0)
    reach = 1.25 * max(float(np.abs(ring - middle).max()), 8.0)
    return join(
        tag("path", d=_saltire(middle, reach), **_line(color, width))
        for color, width in (("#fff", 8.0), (mark.ink.color, 4.5))
    )


def _name(mark: BoltMark, place: FloatArray) -> Html:
    text = clip(mark.name, 10)
    forbidden = mark.ink is Ink.FORBIDDEN
    return tag(
        "text",
        text if mark.is_sure else f"{text}?",
        x=_px(place[0]),
        y=_px(place[1] + 5.5),
        text_anchor="middle",
        class_="name",
        fill="#111" if forbidden or not mark.is_sure else mark.ink.color,
        text_decoration="line-through" if forbidden else None,
    )


def _dot(middle: FloatArray, radius: float, **ink: object) -> Html:
    return tag("circle", cx=_px(middle[0]), cy=_px(middle[1]), r=radius, **ink)


def _saltire(middle: FloatArray, reach: float) -> str:
    left, top = _px(middle[0] - reach), _px(middle[1] - reach)
    low, long = _px(middle[1] + reach), _px(2 * reach)
    return f"M{left} {top}l{long} {long}M{left} {low}l{long} {-long}"


def _polyline(points: FloatArray) -> str:
    return "M" + "L".join(f"{_px(x)} {_px(y)}" for x, y in points)


def _px(value: float) -> float:
    return round(float(value), 1)


def _line(color: str, width: float) -> dict[str, object]:
    return {"fill": "none", "stroke": color, "stroke_width": width}


def view_axes(view_from_camera: Transform, camera_from_frame: Transform) -> FloatArray:
    """The axes of a result's frame as a viewer sees them; shape (3, 3), one per column."""
    return view_from_camera.rotation @ camera_from_frame.rotation
