"""The colours by which the paper's group stores labels, and the way back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from boltpose.arrays import UInt8Array
from boltpose.errors import InputFileError, ShapeError
from boltpose.schema import Part

PALETTE: dict[Part, tuple[int, int, int]] = {
    Part.BACKGROUND: (0, 0, 128),
    Part.MAIN_HOUSING: (0, 100, 0),
    Part.CONNECTOR: (102, 255, 102),
    Part.SOLENOID: (255, 165, 0),
    Part.ELECTRICAL_CONNECTOR: (255, 255, 0),
    Part.GEAR: (102, 140, 255),
    Part.BOLT: (247, 77, 77),
}
"""RGB of every class as in the point clouds of the paper's group (LCE 2024, arXiv 2505.24669)."""

COLOR_TOLERANCE = 3
"""A channel may be off by this: programs keep colours as floats, or compress them, and round. The
two nearest colours of the palette differ by 88 in a channel."""

_RGB = np.array([PALETTE[part] for part in Part], dtype=np.int16)
_SHOWN = 3


def colors_of_labels(labels: npt.ArrayLike) -> UInt8Array:
    """Paint labels.

    Args:
        labels: Shape (N,), integers, `Part` numbers.

    Returns:
        Shape (N, 3), RGB.

    Raises:
        ShapeError: The shape is another one or a label is no `Part`.
    """
    numbers = np.asarray(labels)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise ShapeError(
            f"labels must be integers of shape (N,), got {numbers.dtype} {numbers.shape}"
        )
    if not ((numbers >= 0) & (numbers < len(_RGB))).all():
        raise ShapeError(f"labels must be 0 to {len(_RGB) - 1}, got {numbers.min(initial=0)} to "
                         f"{numbers.max(initial=0)}")  # fmt: skip
    return _RGB[numbers].astype(np.uint8)


def labels_of_colors(path: str | Path, colors: npt.ArrayLike) -> UInt8Array:
    """Read labels from paint.

    Args:
        path: The file, for the error text.
        colors: Shape (N, 3), RGB 0..255; off by at most `COLOR_TOLERANCE` in every channel.

    Returns:
        Shape (N,), `Part` numbers.

    Raises:
        ShapeError: The shape is another one.
        InputFileError: Colours that are not in the palette; the text names the most frequent ones
            with the number of their points.
    """
    rgb = np.asarray(colors)
    if rgb.ndim != 2 or rgb.shape[1] != 3:
        raise ShapeError(f"colors must have shape (N, 3), got {rgb.shape}")
    # each colour is looked up once: clouds of millions of points have a handful
    packed = rgb.astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])
    values, group, counts = np.unique(packed, return_inverse=True, return_counts=True)
    seen = np.stack([values >> 16, (values >> 8) & 255, values & 255], axis=1)
    off = np.abs(seen[:, None] - _RGB[None]).max(axis=2)
    known = off.min(axis=1, initial=COLOR_TOLERANCE + 1) <= COLOR_TOLERANCE
    if not known.all():
        raise InputFileError(path, _describe(seen[~known], counts[~known]), _wanted())
    return off.argmin(axis=1).astype(np.uint8)[group]


def _describe(colors: npt.NDArray[np.int64], counts: npt.NDArray[np.int64]) -> str:
    """Name unknown colours, the most frequent first."""
    order = np.argsort(-counts, kind="stable")
    named = [
        f"({', '.join(map(str, colors[index]))}) on {_points(int(counts[index]))}"
        for index in order[:_SHOWN]
    ]
    rest = order[_SHOWN:]
    if len(rest):
        others = "1 other colour" if len(rest) == 1 else f"{len(rest)} other colours"
        named.append(f"{others} on {_points(int(counts[rest].sum()))}")
    return f"the colour {', '.join(named)}"


def _points(count: int) -> str:
    return "1 point" if count == 1 else f"{count} points"


def _wanted() -> str:
    """Spell the palette out."""
    named = [f"{part.name.lower()} {rgb}" for part, rgb in PALETTE.items()]
    return f"colours of the palette, off by at most {COLOR_TOLERANCE}: {', '.join(named)}"
