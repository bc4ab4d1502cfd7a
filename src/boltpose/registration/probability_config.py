"""Weights of the probability that a pose is right."""

from __future__ import annotations

import math
from dataclasses import dataclass

from boltpose.errors import ConfigError

FEATURES = (
    "tight",
    "weakest_tight",
    "worst_region",
    "sunk",
    "free_space",
    "coverage",
    "margin",
)
"""Numbers that the probability rests on; each has a weight of the same name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbabilityConfig:
    """Weights of the logistic model; none is negative, so better evidence never lowers it."""

    bias: float = -7.44
    tight: float = 1.6
    weakest_tight: float = 0.111
    worst_region: float = 0.0
    sunk: float = 0.354
    free_space: float = 0.0
    coverage: float = 0.0
    margin: float = 0.21
    highest: float = 0.999
    """Nobody may claim more."""

    def __post_init__(self) -> None:
        for name in FEATURES:
            if not 0 <= getattr(self, name) < math.inf:
                raise ConfigError(f"weight {name} must be >= 0, got {getattr(self, name)}")
        if not math.isfinite(self.bias):
            raise ConfigError(f"bias must be finite, got {self.bias}")
        if not 0 < self.highest < 1:
            raise ConfigError(f"highest must lie between 0 and 1, got {self.highest}")
