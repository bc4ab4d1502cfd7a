"""Weights of the probability that a pose is right."""

from __future__ import annotations

import math
from dataclasses import dataclass

from boltpose.errors import ConfigError

FEATURES = (
    "tight",
    "weakest_tight",
    "sunk",
    "free_space",
    "coverage",
    "margin",
)
"""Numbers that the probability rests on; each has a weight of the same name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbabilityConfig:
    """Weights of the logistic model; none is negative, so better evidence never lowers it.

    Fitted to the hard cases of the even families of reman18 and of the factory (simulated) by
    `python -m boltpose.evaluation.hard_fit results/verdict`, which prints them.
    """

    bias: float = -11.97
    tight: float = 0.977
    weakest_tight: float = 1.57
    sunk: float = 0.54
    free_space: float = 0.371
    coverage: float = 0.318
    margin: float = 0.238
    sigma_factor: float = 3.0
    """The true error is taken for this much larger than the stated 1 sigma of a bolt. On even
    families with 80 to 95 % of the motor hidden it was up to 2.0 times the sigma, and 7 times in
    one pose whose refinement had not ended."""
    highest: float = 0.999
    """Nobody may claim more: of n wrong cases that are all told apart no more follows than that at
    most 3 / n are not (95 % confidence), which are 0.001 for the 3300 of the fit; and cases of
    one view are not independent."""

    def __post_init__(self) -> None:
        for name in FEATURES:
            if not 0 <= getattr(self, name) < math.inf:
                raise ConfigError(f"weight {name} must be >= 0, got {getattr(self, name)}")
        if not 0 < self.sigma_factor < math.inf:
            raise ConfigError(f"sigma_factor must be > 0, got {self.sigma_factor}")
        if not math.isfinite(self.bias):
            raise ConfigError(f"bias must be finite, got {self.bias}")
        if not 0 < self.highest < 1:
            raise ConfigError(f"highest must lie between 0 and 1, got {self.highest}")
