"""Do probabilities mean what they say? Reliability by bins, expected calibration error, Brier."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.errors import ShapeError

BINS = 15
"""Bins of equal width, as in Guo et al., ICML 2017."""
CALIBRATION_FORMAT = "boltpose.calibration/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityBin:
    """What was stated and what came true where a probability between `low` and `high` was said."""

    low: float
    """Exclusive, but for the first bin."""
    high: float
    """Inclusive."""
    count: int
    mean_probability: float
    """0 in an empty bin."""
    share_true: float
    """0 in an empty bin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reliability:
    """Stated probabilities against what came true."""

    bins: tuple[ReliabilityBin, ...]
    brier: float
    """Mean square of probability minus truth, 0 to 1; 0 is perfect."""

    @property
    def count(self) -> int:
        """Statements in all bins."""
        return sum(entry.count for entry in self.bins)

    @property
    def expected_error(self) -> float:
        """Expected calibration error (ECE), 0 to 1.

        The mean over all statements of how far the stated probability of their bin is from the
        share that came true.
        """
        off = sum(
            entry.count * abs(entry.mean_probability - entry.share_true) for entry in self.bins
        )
        return off / self.count


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationCurve:
    """One kind of statement of a network, before and after its temperature."""

    statement: str
    """For example `the most probable class` or `bolt`."""
    before: Reliability
    after: Reliability


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkCalibration:
    """How well one network's probabilities hold on families it has not seen."""

    network: str
    """File name."""
    temperature: float
    """Of the shipped network: fitted on all families."""
    temperatures: Mapping[str, float]
    """By family left out: fitted on the others, applied to it."""
    curves: tuple[CalibrationCurve, ...]
    """All families pooled, each labelled by the networks that have not seen it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationRecord:
    """What `python -m boltpose.training calibrate` measured; `results/calibration.json`."""

    format: str
    data: str
    networks: tuple[NetworkCalibration, ...]


def measure_reliability(probability: FloatArray, is_true: BoolArray) -> Reliability:
    """Bin statements by their probability.

    Args:
        probability: Shape (N,), N >= 1, what was stated, 0 to 1.
        is_true: Shape (N,), what came true.

    Returns:
        The bins, all `BINS` of them, and the Brier score.

    Raises:
        ShapeError: The arrays do not belong together, are empty or a probability is not 0 to 1.

    Source:
        Guo et al., ICML 2017, section 2.
    """
    if probability.ndim != 1 or probability.shape != is_true.shape or len(probability) == 0:
        raise ShapeError(
            f"probability and is_true must have one common shape (N,), N >= 1, "
            f"got {probability.shape} and {is_true.shape}"
        )
    if not ((probability >= 0) & (probability <= 1)).all():
        raise ShapeError("probability must be 0 to 1")
    truth = is_true.astype(np.float64)
    place = np.clip(np.ceil(probability * BINS).astype(np.int64) - 1, 0, BINS - 1)
    count = np.bincount(place, minlength=BINS)
    stated = np.bincount(place, probability, BINS) / np.maximum(count, 1)
    came = np.bincount(place, truth, BINS) / np.maximum(count, 1)
    return Reliability(
        bins=tuple(
            ReliabilityBin(
                low=number / BINS,
                high=(number + 1) / BINS,
                count=int(count[number]),
                mean_probability=float(stated[number]),
                share_true=float(came[number]),
            )
            for number in range(BINS)
        ),
        brier=float(np.mean((probability - truth) ** 2)),
    )


def most_probable(probabilities: FloatArray, classes: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return the probability, (N,), of the most probable class and whether it is the right one."""
    best = probabilities.argmax(axis=1)
    return probabilities[np.arange(len(best)), best], best == classes


def scale_probabilities(probabilities: FloatArray, temperature: float) -> FloatArray:
    """Probabilities, (N, C), as they are once their logarithms are divided by the temperature."""
    scaled = np.log(np.maximum(probabilities, 1e-7)) / temperature
    scaled = np.exp(scaled - scaled.max(axis=1, keepdims=True))
    return scaled / scaled.sum(axis=1, keepdims=True)
