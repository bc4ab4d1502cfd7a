"""How well points are labelled: overall accuracy and intersection over union."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from boltpose.arrays import IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationScores:
    """Scores of one labelling, or of several pooled."""

    overall_accuracy: float
    mean_iou: float
    """Mean over the classes that occur."""
    iou: Mapping[str, float]
    """Per class that occurs."""
    points: int

    def to_json(self) -> dict[str, Any]:
        """JSON-ready values, rounded to 5 decimals."""
        return {
            "overall_accuracy": round(self.overall_accuracy, 5),
            "mean_iou": round(self.mean_iou, 5),
            "iou": {name: round(value, 5) for name, value in self.iou.items()},
            "points": self.points,
        }


def confusion_matrix(truth: npt.ArrayLike, guess: npt.ArrayLike, classes: int) -> IntArray:
    """Count points by true class (row) and label given (column); shape (classes, classes)."""
    pairs = np.asarray(truth, dtype=np.int64) * classes + np.asarray(guess, dtype=np.int64)
    return np.bincount(pairs, minlength=classes * classes).reshape(classes, classes)


def score_confusion(confusion: IntArray, names: Sequence[str]) -> SegmentationScores:
    """Scores of a confusion matrix, shape (classes, classes), true classes in rows.

    Raises:
        ValueError: It counts no point, or there are not as many names as classes.
    """
    if confusion.shape != (len(names), len(names)):
        raise ValueError(f"confusion must be {len(names)} x {len(names)}, got {confusion.shape}")
    total = int(confusion.sum())
    if total == 0:
        raise ValueError("confusion must count at least one point")
    right = np.diag(confusion).astype(np.float64)
    union = confusion.sum(axis=0) + confusion.sum(axis=1) - right
    iou = {
        name: float(hit / all_of)
        for name, hit, all_of in zip(names, right, union, strict=True)
        if all_of
    }
    return SegmentationScores(
        overall_accuracy=float(right.sum() / total),
        mean_iou=float(np.mean(list(iou.values()))),
        iou=iou,
        points=total,
    )
