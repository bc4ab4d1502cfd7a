"""The paper the pictures are drawn on: banner, panels, footer; saved whole or not at all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from boltpose.arrays import FloatArray
from boltpose.errors import InputFileError
from boltpose.io.atomic import write_atomic

DPI = 100

_BANNER_PX = 46
_FOOTER_PX = 64
_NO_DATE = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """Where an image lies on the sheet, pixels from the top left, banner excluded."""

    left: int
    top: int
    width: int
    height: int


class Sheet:
    """A figure laid out in whole pixels, so that images are shown dot for dot."""

    def __init__(self, width: int, height: int) -> None:
        self._width = width
        self._height = height + _BANNER_PX + _FOOTER_PX
        self._figure = Figure(
            figsize=(self._width / DPI, self._height / DPI), dpi=DPI, facecolor="white"
        )
        FigureCanvasAgg(self._figure)

    def banner(self, headline: str, detail: str, color: str) -> None:
        """Write the verdict across the top."""
        axes = self._axes(0, 0, self._width, _BANNER_PX)
        axes.add_patch(Rectangle((0, 0), self._width, _BANNER_PX, facecolor=color))
        axes.text(
            14, _BANNER_PX / 2, headline, color="white", fontsize=19, fontweight="bold", va="center"
        )
        axes.text(
            self._width - 14,
            _BANNER_PX / 2,
            detail,
            color="white",
            fontsize=12,
            va="center",
            ha="right",
            parse_math=False,
        )

    def panel(self, place: Panel, image: FloatArray | None, title: str) -> Axes:
        """Add a panel; its axes count pixels, origin top left.

        Args:
            place: Where.
            image: Shape (height, width, 3), 0 to 1; None leaves it white.
            title: Written into the top left corner.

        Returns:
            The axes to draw on.
        """
        axes = self._axes(place.left, place.top + _BANNER_PX, place.width, place.height)
        if image is not None:
            axes.imshow(image, extent=(0, place.width, place.height, 0), interpolation="nearest")
        axes.set_xlim(0, place.width)
        axes.set_ylim(place.height, 0)
        axes.text(
            10,
            8,
            title,
            fontsize=11.5,
            va="top",
            color="#222222",
            bbox={"boxstyle": "round,pad=0.25", "fc": "white", "ec": "none", "alpha": 0.8},
        )
        axes.add_patch(
            Rectangle((0, 0), place.width, place.height, fill=False, ec="#b8b8b8", lw=1.2)
        )
        return axes

    def footer(self, handles: list[Line2D], text: str) -> None:
        """Explain the marks and name what the picture was made from."""
        axes = self._axes(0, self._height - _FOOTER_PX, self._width, _FOOTER_PX)
        if handles:
            axes.legend(
                handles=handles,
                loc="upper left",
                ncols=len(handles),
                frameon=False,
                fontsize=11,
                handlelength=3.2,
                borderaxespad=0.3,
            )
        axes.text(12, 10, text, fontsize=9, color="#555555", va="bottom", parse_math=False)

    def save(self, path: Path) -> None:
        """Write the picture; the suffix chooses the format.

        Raises:
            InputFileError: The suffix is none of .png, .svg, .pdf, or the place is not writable.
        """
        kind = path.suffix.lower().removeprefix(".")
        if kind not in _NO_DATE:
            raise InputFileError(path, f"the ending '{path.suffix}'", ".png, .svg or .pdf")

        def write(stream: BinaryIO) -> None:
            # no date and no random ids: the same result gives the same file
            with matplotlib.rc_context({"svg.hashsalt": "boltpose"}):
                self._figure.savefig(stream, format=kind, dpi=DPI, metadata=_NO_DATE[kind])

        write_atomic(path, write)

    def _axes(self, left: int, top: int, width: int, height: int) -> Axes:
        axes = self._figure.add_axes(
            (
                left / self._width,
                1 - (top + height) / self._height,
                width / self._width,
                height / self._height,
            )
        )
        axes.set_xlim(0, width)
        axes.set_ylim(0, height)
        axes.set_axis_off()
        return axes
