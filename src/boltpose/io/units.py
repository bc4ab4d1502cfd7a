"""Length units of files, and the guards that notice a wrong one by the size of the data.

Nothing is scaled on suspicion: a file whose size does not fit its stated unit is refused with
the option to set.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import numpy as np

from boltpose.arrays import AnyArray
from boltpose.errors import ConfigError, UnitError

MIN_EXTENT_MM = 30.0
"""Smaller scans are no motors. Starter motors are 150 to 350 mm long, that is 0.15 to 0.35 m,
15 to 35 cm or 6 to 14 inch: read as mm, none of the three gets past this."""
MAX_EXTENT_MM = 10_000.0
"""Structured-light scanners measure up to about 3 m; a motor in mm read as m spans 150 m."""
MIN_TRANSLATION_MM = 5.0
"""Cameras stand 0.3 to 3 m from a robot's foot or flange; in metres that is below 5."""
MAX_TRANSLATION_MM = 20_000.0
"""Farther than any robot cell; 100 mm taken for metres is 100000."""

_TYPICAL_EXTENT_MM = (80.0, 3000.0)
_TYPICAL_TRANSLATION_MM = (50.0, 5000.0)
_SAMPLE = 200_000


class Unit(StrEnum):
    """Unit of length in a file; inside, everything is millimetres."""

    MM = "mm"
    M = "m"
    CM = "cm"
    INCH = "inch"

    @property
    def mm(self) -> float:
        """Millimetres in one of this unit."""
        return _MM[self]


_MM = {Unit.MM: 1.0, Unit.M: 1000.0, Unit.CM: 10.0, Unit.INCH: 25.4}


def as_unit(unit: str) -> Unit:
    """Return the unit of that name.

    Raises:
        ConfigError: There is no such unit.
    """
    try:
        return Unit(unit)
    except ValueError:
        known = ", ".join(Unit)
        raise ConfigError(f"unknown unit '{unit}', there are {known}") from None


def robust_extent(points: AnyArray) -> float:
    """Return the longest side of the box that holds the middle 98 % of the points on each axis.

    A few stray points far away do not hide that a scan is in metres.

    Args:
        points: Shape (N, 3), N >= 1, finite, any unit.

    Returns:
        The side, in the unit of the points.
    """
    step = max(1, len(points) // _SAMPLE)
    sample = points[::step].astype(np.float64)
    low, high = np.percentile(sample, [1, 99], axis=0, method="nearest")
    with np.errstate(over="ignore"):  # infinite is refused like any other extent
        return float((high - low).max())


def check_extent(path: str | Path, extent: float, unit: Unit, *, option: str) -> None:
    """Refuse data whose size does not fit its unit.

    Args:
        path: The file, for the error text.
        extent: Longest side of the data, in `unit`.
        unit: The unit the user stated or accepted.
        option: The command-line option that sets the unit.

    Raises:
        UnitError: The extent is not within `MIN_EXTENT_MM` to `MAX_EXTENT_MM`.
    """
    if MIN_EXTENT_MM <= extent * unit.mm <= MAX_EXTENT_MM:
        return
    hint = _hint(extent, _TYPICAL_EXTENT_MM, (MIN_EXTENT_MM, MAX_EXTENT_MM), option)
    raise UnitError(
        path,
        f"an extent of {extent:.4g} {unit}{hint}",
        f"{MIN_EXTENT_MM:g} to {MAX_EXTENT_MM:g} mm",
    )


def check_translation(path: str | Path, length: float, unit: Unit, *, option: str) -> None:
    """Refuse a transform whose translation does not fit its unit; exactly zero is legal.

    Args:
        path: The file, for the error text.
        length: Norm of the translation, in `unit`.
        unit: The unit the user stated or accepted.
        option: The command-line option that sets the unit.

    Raises:
        UnitError: The length is neither 0 nor within `MIN_TRANSLATION_MM` to
            `MAX_TRANSLATION_MM`.
    """
    if length == 0 or MIN_TRANSLATION_MM <= length * unit.mm <= MAX_TRANSLATION_MM:
        return
    hint = _hint(length, _TYPICAL_TRANSLATION_MM, (MIN_TRANSLATION_MM, MAX_TRANSLATION_MM), option)
    raise UnitError(
        path,
        f"a translation of {length:.4g} {unit}{hint}",
        f"{MIN_TRANSLATION_MM:g} to {MAX_TRANSLATION_MM:g} mm, or exactly 0",
    )


def _hint(
    length: float, typical_mm: tuple[float, float], allowed_mm: tuple[float, float], option: str
) -> str:
    """Name the first unit, metres before millimetres, in which the length is best explained."""
    for low_mm, high_mm in (typical_mm, allowed_mm):
        for unit in (Unit.M, Unit.MM, Unit.CM, Unit.INCH):
            if low_mm <= length * unit.mm <= high_mm:
                return f" (looks like {unit}: set {option} {unit})"
    return f" (no unit fits; {option} sets it)"
