"""Data sets side by side: the ranges of what differs from motor to motor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from boltpose.synthesis.statistics import (
    CLASS_NAMES,
    DataSetStatistics,
    MotorStatistics,
    ViewStatistics,
    quantiles,
)

_OfMotor = Callable[[MotorStatistics], float]
_OfView = Callable[[ViewStatistics], float]

_SIZES: dict[str, _OfMotor] = {
    "yoke radius, mm": lambda motor: motor.yoke_radius_mm,
    "yoke length, mm": lambda motor: motor.yoke_length_mm,
    "whole length (z), mm": lambda motor: motor.size_mm[2],
    "whole height (y), mm": lambda motor: motor.size_mm[1],
    "whole width (x), mm": lambda motor: motor.size_mm[0],
}
_SOLENOID: dict[str, _OfMotor] = {
    "solenoid radius, mm": lambda motor: motor.solenoid_radius_mm,
    "solenoid length, mm": lambda motor: motor.solenoid_length_mm,
    "solenoid offset, mm": lambda motor: motor.solenoid_offset_mm,
}
_VIEWS: dict[str, _OfView] = {
    "camera distance, mm": lambda view: view.distance_mm,
    "valid pixels per view, thousands": lambda view: view.valid_pixels / 1000,
    "motor pixels per view, thousands": lambda view: view.motor_pixels / 1000,
    "motor's share of the pixels, %": lambda view: (
        100 * view.motor_pixels / max(1, view.valid_pixels)
    ),
    "bolts not visible per view, %": lambda view: 100 * view.hidden_share,
}


def compare_table(data_sets: Sequence[DataSetStatistics], names: Sequence[str]) -> str:
    """Lay out data sets in columns, as Markdown.

    Args:
        data_sets: At least one.
        names: The heading of each column.

    Returns:
        A table; ranges are minimum / median / maximum.
    """
    rows: list[tuple[str, list[str]]] = []

    def add(title: str, cell: Callable[[DataSetStatistics], str]) -> None:
        rows.append((title, [cell(data) for data in data_sets]))

    add("motors", lambda data: f"{len(data.motors)}")
    add("families", lambda data: f"{len({motor.family for motor in data.motors})}")
    for title, size in _SIZES.items():
        add(title, lambda data, of=size: _range([of(motor) for motor in data.motors]))
    add("motors without a solenoid", lambda data: _without_solenoid(data))
    for title, size in _SOLENOID.items():
        add(
            title,
            lambda data, of=size: _range(
                [of(motor) for motor in data.motors if motor.solenoid_radius_mm > 0]
            ),
        )
    add("bolts per motor", lambda data: _range([len(motor.bolts) for motor in data.motors]))
    add("kinds of heads", lambda data: f"{len({bolt.head for bolt in data.bolts})}")
    add("heads by thread", lambda data: f"{len({bolt.kind for bolt in data.bolts})}")
    add("bolts with the head to the drive end, %", _top_share)
    add("scan points, thousands", lambda d: _range([m.scan_points / 1000 for m in d.motors]))
    add("scan points per bolt", lambda d: _range([bolt.scan_points for bolt in d.bolts]))
    for index, part in enumerate(CLASS_NAMES):
        add(
            f"{part.replace('_', ' ')}, % of the points",
            lambda data, at=index: _range([_share(motor, at) for motor in data.motors]),
        )
    if any(data.views for data in data_sets):
        add("views", lambda data: f"{len(data.views)}")
        add("clamp designs", lambda data: f"{len({view.clamp for view in data.views})}")
        for title, number in _VIEWS.items():
            add(title, lambda data, of=number: _range([of(view) for view in data.views]))
        add("visible fraction of visible bolts", _visible_fraction)
        add("bolts gone since the scan", lambda data: f"{sum(view.gone for view in data.views)}")
    lines = [
        f"| | {' | '.join(names)} |",
        f"|---|{'---|' * len(names)}",
        *(f"| {title} | {' | '.join(cells)} |" for title, cells in rows),
    ]
    return "\n".join(lines) + "\n"


def count_table(heading: str, names: Sequence[str]) -> str:
    """How often each name occurs, the most frequent first, as a Markdown table."""
    counts = Counter(names)
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    rows = [f"| {name} | {count} | {100 * count / len(names):.1f} % |" for name, count in ordered]
    return "\n".join([f"| {heading} | count | share |", "|---|---|---|", *rows]) + "\n"


def _range(values: Sequence[float]) -> str:
    if not values:
        return "-"
    low, middle, high = quantiles(values, 0, 0.5, 1)
    digits = 0 if high >= 100 else 1 if high >= 10 else 2
    if all(float(value).is_integer() for value in values):
        return f"{low:.0f} / {middle:g} / {high:.0f}"
    return f"{low:.{digits}f} / {middle:.{digits}f} / {high:.{digits}f}"


def _share(motor: MotorStatistics, part: int) -> float:
    return 100 * motor.class_points[part] / max(1, sum(motor.class_points))


def _without_solenoid(data: DataSetStatistics) -> str:
    return f"{sum(motor.solenoid_radius_mm == 0 for motor in data.motors)}"


def _top_share(data: DataSetStatistics) -> str:
    return f"{100 * float(np.mean([bolt.side == 'top' for bolt in data.bolts] or [0])):.0f}"


def _visible_fraction(data: DataSetStatistics) -> str:
    return _range(
        [
            fraction
            for view in data.views
            for fraction, is_visible in zip(view.visible_fractions, view.is_visible, strict=True)
            if is_visible
        ]
    )
