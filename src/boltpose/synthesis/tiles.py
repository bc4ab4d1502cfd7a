"""Pictures side by side, with a line of text below each, as one JPEG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from boltpose.arrays import UInt8Array
from boltpose.io.atomic import write_atomic

_CAPTION_PX = 24
_GAP_PX = 8
_INK = (40, 40, 40)
_PAPER = (255, 255, 255)


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One picture and what stands below it."""

    image: UInt8Array
    """Shape (H, W, 3)."""
    caption: str


def sheet(tiles: Sequence[Tile], columns: int) -> UInt8Array:
    """Lay out tiles row by row.

    Args:
        tiles: At least one, all of one size.
        columns: Tiles per row.

    Returns:
        Shape (H, W, 3).
    """
    height, width = tiles[0].image.shape[:2]
    rows = -(-len(tiles) // columns)
    columns = min(columns, len(tiles))
    step = (width + _GAP_PX, height + _CAPTION_PX + _GAP_PX)
    paper = Image.new("RGB", (columns * step[0] - _GAP_PX, rows * step[1] - _GAP_PX), _PAPER)
    pen = ImageDraw.Draw(paper)
    font = ImageFont.load_default(15)
    for index, tile in enumerate(tiles):
        x, y = index % columns * step[0], index // columns * step[1]
        paper.paste(Image.fromarray(tile.image), (x, y))
        middle = (x + width / 2, y + height + _CAPTION_PX / 2)
        pen.text(middle, tile.caption, fill=_INK, font=font, anchor="mm")
    return np.asarray(paper)


def write_jpeg(path: Path, image: UInt8Array, *, quality: int = 85) -> Path:
    """Write a picture whole or not at all.

    Raises:
        OSError: The folder is missing or not writable.
    """
    write_atomic(
        path,
        lambda stream: Image.fromarray(image).save(
            stream, format="JPEG", quality=quality, optimize=True
        ),
    )
    return path
