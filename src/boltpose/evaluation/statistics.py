"""Median, 95 % and maximum: how errors are told everywhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A list of numbers in three."""

    count: int
    median: float
    p95: float
    """95 % of the numbers are at most this, linearly interpolated."""
    maximum: float


def spread_of(values: Iterable[float]) -> Spread | None:
    """Summarise numbers; None if there are none, which no number would tell.

    Raises:
        ValueError: A number is not finite.
    """
    array = np.array(list(values), dtype=np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{int((~np.isfinite(array)).sum())} of {len(array)} are not finite")
    if len(array) == 0:
        return None
    return Spread(
        count=len(array),
        median=float(np.median(array)),
        p95=float(np.percentile(array, 95)),
        maximum=float(array.max()),
    )


def share_of(flags: Iterable[bool]) -> float | None:
    """Share of true flags, 0 to 1; None if there are none."""
    every = list(flags)
    return sum(every) / len(every) if every else None
