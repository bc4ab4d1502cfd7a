"""Small helpers for drawing specifications: rounded numbers, choices, room that is taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from boltpose.factory.solids import polar

T = TypeVar("T")


def between(rng: np.random.Generator, low: float, high: float, digits: int = 2) -> float:
    """A uniform number, rounded as a person would write it down."""
    return round(float(rng.uniform(low, high)), digits)


def whole(rng: np.random.Generator, low: int, high: int) -> int:
    """A uniform whole number, both ends included."""
    return int(rng.integers(low, high + 1))


def one_of(rng: np.random.Generator, options: Sequence[T]) -> T:
    """One of several; repeat one to make it likelier."""
    return options[int(rng.integers(len(options)))]


def happens(rng: np.random.Generator, probability: float) -> bool:
    """Whether something of this probability happens."""
    return bool(rng.random() < probability)


def angle_apart_deg(first: float, second: float) -> float:
    """Smallest angle between two directions, 0 to 180."""
    return abs((first - second + 180) % 360 - 180)


class Room:
    """Discs already taken on one side of a motor, seen along the axis."""

    def __init__(self) -> None:
        self._taken: list[tuple[float, float, float]] = []

    def take(
        self,
        radius_mm: float,
        angle_deg: float,
        size_mm: float,
        origin: tuple[float, float] = (0, 0),
    ) -> bool:
        """Take a disc if it is free; tell whether it was."""
        if not self.is_free(radius_mm, angle_deg, size_mm, origin):
            return False
        x, y = polar(radius_mm, angle_deg)
        self._taken.append((x + origin[0], y + origin[1], size_mm))
        return True

    def is_free(
        self,
        radius_mm: float,
        angle_deg: float,
        size_mm: float,
        origin: tuple[float, float] = (0, 0),
    ) -> bool:
        """Whether a disc is free."""
        x, y = polar(radius_mm, angle_deg)
        x, y = x + origin[0], y + origin[1]
        return all(
            math.hypot(x - other_x, y - other_y) >= size_mm + other_size
            for other_x, other_y, other_size in self._taken
        )
