"""Bolts, their names and the scale bar, drawn over an image."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke

from boltpose.arrays import FloatArray
from boltpose.picture.bolt_marks import (
    BoltMark,
    Ink,
    arrow_ends,
    head_ring,
    place_names,
    scale_bar_mm,
)
from boltpose.picture.view import View

_HALO = [withStroke(linewidth=2.5, foreground="white")]


def draw_bolts(axes: Axes, view: View, marks: list[BoltMark]) -> None:
    """Draw a ring around every head, an arrow along every axis and the names beside them."""
    shafts = np.zeros((len(marks), 2, 2))
    for number, mark in enumerate(marks):
        ring = head_ring(view, mark)
        shafts[number] = tail, tip = arrow_ends(view, mark)
        if mark.ink is Ink.FORBIDDEN:
            shafts[number, 1] = tail
            _cross_out(axes, ring)
            continue
        _draw_head(axes, ring, mark.ink)
        _draw_arrow(axes, tail, tip, mark.ink)
    for mark, place in zip(marks, place_names(shafts, view), strict=True):
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
            parse_math=False,  # a name is no formula, whatever is in it
            path_effects=_HALO if mark.is_sure else None,
            bbox=None
            if mark.is_sure
            else {"boxstyle": "round,pad=0.18", "fc": "#ffe14d", "ec": "black", "lw": 0.8},
        )


def _cross_out(axes: Axes, ring: FloatArray) -> None:
    """A cross over the head, larger than it: nobody must take this for a target."""
    middle = ring[:-1].mean(axis=0)
    reach = 1.25 * max(float(np.abs(ring - middle).max()), 7.0)
    for color, width in (("white", 6.0), (Ink.FORBIDDEN.color, 3.2)):
        for slope in (1, -1):
            axes.plot(
                [middle[0] - reach, middle[0] + reach],
                [middle[1] - slope * reach, middle[1] + slope * reach],
                color=color,
                lw=width,
                zorder=5,
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


def draw_scale_bar(axes: Axes, view: View) -> None:
    """Draw a bar of a round length, true at the subject's distance."""
    length_mm = scale_bar_mm(view)
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
            ls="" if ink is Ink.FORBIDDEN else ink.dashes,
            marker="x" if ink is Ink.FORBIDDEN else ">",
            ms=8,
            mfc=ink.color if ink.is_solid else "white",
            mec=ink.color,
            mew=2.5 if ink is Ink.FORBIDDEN else 1.0,
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
