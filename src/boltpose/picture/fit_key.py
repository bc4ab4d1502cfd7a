"""The key to the colours of a fit."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from boltpose.picture import paint
from boltpose.picture.fit import FULL_MM
from boltpose.picture.sheet import Panel


def draw_fit_key(axes: Axes, place: Panel) -> None:
    """Explain the colours in the panel's lower corners."""
    right, bottom = place.width, place.height
    ramp = paint.distance_tints(np.linspace(0, FULL_MM, 64), FULL_MM)
    axes.imshow(
        ramp[None],
        extent=(right - 132, right - 32, bottom - 18, bottom - 28),
        aspect="auto",
        zorder=3,
    )
    for column, row, text, align in (
        (right - 132, bottom - 31, "scan to prior", "left"),
        (right - 132, bottom - 2, "0", "center"),
        (right - 32, bottom - 2, f"{FULL_MM:g} mm", "center"),
    ):
        axes.text(column, row, text, ha=align, va="bottom", fontsize=8.5, color="#222222")
    axes.text(
        10,
        bottom - 6,
        "blue: prior that no scan point covers",
        fontsize=8.5,
        va="bottom",
        color="#1c4fa0",
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.75},
    )
