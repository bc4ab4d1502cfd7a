"""Motor or not: the points of a view after the registered prior has labelled them again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from boltpose.arrays import BoolArray
from boltpose.errors import InputFileError


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskCounts:
    """How many points of a view were called what."""

    motor_as_motor: int
    motor_as_background: int
    background_as_motor: int
    background_as_background: int

    @property
    def points(self) -> int:
        """All points."""
        right = self.motor_as_motor + self.background_as_background
        return right + self.motor_as_background + self.background_as_motor


def count_mask(is_motor: BoolArray, depth: Path, label: Path) -> MaskCounts:
    """Compare a mask with the truth.

    Args:
        is_motor: Shape (N,), one per pixel with a measurement, row by row.
        depth: Depth image, 0 where nothing was measured.
        label: Class of every pixel, 0 is background.

    Raises:
        InputFileError: The images do not have as many measurements as the mask.
    """
    with Image.open(depth) as image:
        is_measured = np.asarray(image) > 0
    with Image.open(label) as image:
        truth = np.asarray(image)[is_measured] != 0
    if truth.shape != is_motor.shape:
        found = f"{len(truth)} measured pixels"
        raise InputFileError(depth, found, f"{len(is_motor)}, as the scan has points")
    return MaskCounts(
        motor_as_motor=int(np.sum(truth & is_motor)),
        motor_as_background=int(np.sum(truth & ~is_motor)),
        background_as_motor=int(np.sum(~truth & is_motor)),
        background_as_background=int(np.sum(~truth & ~is_motor)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskScores:
    """Scores of all points of some views together."""

    views: int
    overall_accuracy: float
    mean_iou: float


def score_masks(counts: list[MaskCounts]) -> MaskScores | None:
    """Overall accuracy and mean IoU of motor and background; None without any view."""
    if not counts:
        return None
    hit = sum(count.motor_as_motor for count in counts)
    miss = sum(count.motor_as_background for count in counts)
    false = sum(count.background_as_motor for count in counts)
    clear = sum(count.background_as_background for count in counts)
    ious = [hit / max(1, hit + miss + false), clear / max(1, clear + miss + false)]
    return MaskScores(
        views=len(counts),
        overall_accuracy=(hit + clear) / max(1, hit + miss + false + clear),
        mean_iou=sum(ious) / 2,
    )
