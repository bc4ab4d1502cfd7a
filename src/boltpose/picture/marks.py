"""Bolts, their names and the scale bar, drawn over an image."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.picture.view import View
from boltpose.schema import Visibility

ARROW_MM = 26.0
_RING = np.linspace(0, 2 * np.pi, 33)
_HALO = [withStroke(linewidth=2.5, foreground="white")]


class Ink(Enum):
    """How a bolt is drawn; a person who sees no colours still has the dashes and hollow heads."""

    SEEN = ("#c8102e", "-", True, "seen")
    PARTIAL = ("#c8102e", "-", False, "partly seen")
    HIDDEN = ("#d9730d", (0, (3, 1.6)), False, "hidden: pose known from the prior")

    def __init__(
        self, color: str, dashes: str | tuple[int, tuple[float, float]], is_solid: bool, label: str
    ) -> None:
        self.color = color
        self.dashes = dashes
        self.is_solid = is_solid
        self.label = label


INK_OF = {
    Visibility.VISIBLE: Ink.SEEN,
    Visibility.PARTIAL: Ink.PARTIAL,
    Visibility.HIDDEN: Ink.HIDDEN,
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoltMark:
    """One bolt to draw."""

    name: str
    scene_from_bolt: Transform
    """Frame of the picture's points from frame `bolt`."""
    head_diameter_mm: float
    ink: Ink
    is_sure: bool


def draw_bolts(axes: Axes, view: View, marks: list[BoltMark]) -> None:
    """Draw a ring around every head, an arrow along every axis and the names beside them."""
    shafts = np.zeros((len(marks), 2, 2))
    for number, mark in enumerate(marks):
        ring_bolt = np.stack([np.cos(_RING), np.sin(_RING), np.zeros_like(_RING)], axis=1)
        ring_bolt *= mark.head_diameter_mm / 2
        ends_bolt = np.array([[0, 0, 0], [0, 0, ARROW_MM]])
        ring = view.project(mark.scene_from_bolt.apply(ring_bolt))[:, :2]
        tail, tip = view.project(mark.scene_from_bolt.apply(ends_bolt))[:, :2]
        shafts[number] = tail, tip
        _draw_head(axes, ring, mark.ink)
        _draw_arrow(axes, tail, tip, mark.ink)
    for mark, place in zip(marks, _place_names(shafts, view), strict=True):
        axes.text(
            float(place[0]),
            float(place[1]),
            mark.name if mark.is_sure else f"{mark.name} ?",
            color=mark.ink.color if mark.is_sure else "black",
            fontsize=10.5,
            fontweight="bold",
            ha="center",
            va="center",
            zorder=6,
            path_effects=_HALO if mark.is_sure else None,
            bbox=None
            if mark.is_sure
            else {"boxstyle": "round,pad=0.18", "fc": "#ffe14d", "ec": "black", "lw": 0.8},
        )


def _draw_head(axes: Axes, ring: FloatArray, ink: Ink) -> None:
    axes.add_patch(
        Polygon(
            ring,
            closed=True,
            facecolor=ink.color if ink.is_solid else "none",
            alpha=0.35 if ink.is_solid else None,
            edgecolor="none",
            zorder=3,
        )
    )
    axes.add_patch(Polygon(ring, closed=True, fill=False, ec="white", lw=3.0, zorder=3))
    axes.add_patch(
        Polygon(ring, closed=True, fill=False, ec=ink.color, lw=1.5, ls=ink.dashes, zorder=4)
    )


def _draw_arrow(axes: Axes, tail: FloatArray, tip: FloatArray, ink: Ink) -> None:
    if np.linalg.norm(tip - tail) < 6:
        axes.plot(
            *tail,
            marker="o",
            ms=5,
            mfc=ink.color if ink.is_solid else "white",
            mec=ink.color,
            mew=1.5,
            zorder=5,
        )
        return
    ends = (tuple(tail), tuple(tip))
    axes.plot([tail[0], tip[0]], [tail[1], tip[1]], color="white", lw=4.2, zorder=4)
    axes.plot(
        [tail[0], tip[0]], [tail[1], tip[1]], color=ink.color, lw=2.0, ls=ink.dashes, zorder=5
    )
    axes.add_patch(
        FancyArrowPatch(
            *ends,
            arrowstyle="-|>",
            mutation_scale=15,
            shrinkA=0,
            shrinkB=0,
            lw=0,
            facecolor=ink.color,
            edgecolor="none",
            zorder=5,
        )
    )
    if not ink.is_solid:
        back = tip - (tip - tail) / np.linalg.norm(tip - tail) * 2.2
        axes.add_patch(
            FancyArrowPatch(
                tuple(tail),
                tuple(back),
                arrowstyle="-|>",
                mutation_scale=8,
                shrinkA=0,
                shrinkB=0,
                lw=0,
                facecolor="white",
                edgecolor="none",
                zorder=6,
            )
        )


def _place_names(shafts: FloatArray, view: View) -> list[FloatArray]:
    """Put each name near its arrow's tip where it covers no other name and no arrow.

    Args:
        shafts: Shape (N, 2, 2), pixels: tail and tip of every arrow.
        view: The picture.

    Returns:
        One centre, shape (2,), per arrow.
    """
    along = shafts[:, 0, None] + np.linspace(0, 1, 9)[None, :, None] * np.diff(shafts, axis=1)
    places: list[FloatArray] = []
    for number, (tail, tip) in enumerate(shafts):
        direction = tip - tail
        length = float(np.linalg.norm(direction))
        # an arrow seen end on has no direction: the name goes up and to the right of it
        heading = np.arctan2(direction[1], direction[0]) if length > 8 else -np.pi / 4
        turns = heading + np.radians([0, 35, -35, 70, -70, 105, -105, 140, -140, 180])
        options = np.concatenate(
            [tip + reach * np.stack([np.cos(turns), np.sin(turns)], axis=1) for reach in (18, 30)]
        )
        cost = np.tile(np.linspace(0, 3, len(turns)), 2) + np.repeat([0.0, 2.0], len(turns))
        others = np.delete(along, number, axis=0).reshape(-1, 2)
        cost += 4.0 * _crowding(options, others, 15)
        cost += 2.0 * _crowding(options, along[number], 12)
        cost += 9.0 * _crowding(options, np.array(places).reshape(-1, 2), 32)
        inside = np.clip(options, (20, 14), (view.width - 20, view.height - 14))
        cost += 0.5 * np.abs(options - inside).sum(axis=1)
        places.append(inside[int(np.argmin(cost))])
    return places


def _crowding(options: FloatArray, others: FloatArray, reach: float) -> FloatArray:
    """How deep each option, shape (M, 2), lies in the surroundings of the others; shape (M,)."""
    if len(others) == 0:
        return np.zeros(len(options))
    difference = options[:, None] - others[None]
    # a name is about one and a half times as wide as high
    distance = np.hypot(difference[..., 0], 1.5 * difference[..., 1])
    return np.clip(1 - distance / reach, 0, None).max(axis=1) * 3


def draw_scale_bar(axes: Axes, view: View) -> None:
    """Draw a bar of a round length, true at the subject's distance."""
    wanted_mm = 0.22 * view.width / view.pixels_per_mm
    length_mm = max(
        (size for size in (1, 2, 5, 10, 20, 50, 100, 200, 500) if size <= wanted_mm), default=1
    )
    length = length_mm * view.pixels_per_mm
    left, bottom = 0.03 * view.width, view.height - 0.035 * view.height
    axes.plot([left, left + length], [bottom, bottom], color="black", lw=3, solid_capstyle="butt")
    axes.text(
        left + length / 2,
        bottom - 7,
        f"{length_mm} mm",
        ha="center",
        va="bottom",
        fontsize=9,
        path_effects=_HALO,
    )


def legend_handles(inks: list[Ink], *, with_unsure: bool) -> list[Line2D]:
    """Entries that explain the marks in use."""
    handles = [
        Line2D(
            [],
            [],
            color=ink.color,
            lw=2,
            ls=ink.dashes,
            marker=">",
            ms=8,
            mfc=ink.color if ink.is_solid else "white",
            mec=ink.color,
            label=ink.label,
        )
        for ink in inks
    ]
    if with_unsure:
        handles.append(
            Line2D(
                [],
                [],
                ls="",
                marker="s",
                ms=10,
                mfc="#ffe14d",
                mec="black",
                label="?  unsure: a person should look",
            )
        )
    return handles
