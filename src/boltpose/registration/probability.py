"""Probability that a pose is right, from all evidence together."""

from __future__ import annotations

import math

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.registration.evidence import Evidence
from boltpose.registration.probability_config import FEATURES, ProbabilityConfig

_LIMIT_MM = 2.0
"""A bolt farther off makes a pose wrong."""
_FLOORS = {
    "tight": 0.002,
    "weakest_tight": 0.005,
    "sunk": 0.001,
    "free_space": 0.0005,
    "coverage": 0.02,
}
"""Shares of misfit below these are measuring error: they do not speak for a pose any louder."""


def probability_correct(evidence: Evidence, config: ProbabilityConfig | None = None) -> float:
    """Probability that every bolt is at most 2 mm and 2 degrees off.

    A pose can be wrong in two ways: the scan does not fit it, which a logistic of the features
    tells, or what fits does not hold it, which its covariance tells. Both must be right.

    Args:
        evidence: What the scan says about the pose.
        config: Weights.

    Returns:
        0 to `config.highest`.

    Source:
        Platt, "Probabilistic outputs for support vector machines", in Advances in Large Margin
        Classifiers, 1999: a logistic of a score; here of several, with weights that cannot be
        negative, times the probability of an error below 2 mm, and an upper bound.
    """
    config = config or ProbabilityConfig()
    weights = np.array([getattr(config, name) for name in FEATURES])
    score = config.bias + float(weights @ features(evidence))
    sigma_mm = config.sigma_factor * evidence.bolt_sigma_mm
    if not (math.isfinite(score) and math.isfinite(sigma_mm)):
        return 0.0
    fits = 1.0 / (1.0 + math.exp(-min(max(score, -500.0), 500.0)))
    is_held = math.erf(_LIMIT_MM / (math.sqrt(2.0) * max(sigma_mm, 1e-9)))
    return min(config.highest, fits * is_held)


def features(evidence: Evidence) -> FloatArray:
    """Transform the numbers so that a step of one is a factor, and more is better.

    Returns:
        Shape (6,), in the order of `FEATURES`: minus the logarithm of every share of misfit above
        its floor, and the logarithm of the margin.
    """
    misfit = {
        "tight": 1.0 - evidence.tight,
        "weakest_tight": 1.0 - evidence.weakest_tight,
        "sunk": evidence.sunk,
        "free_space": evidence.free_space_violation,
        "coverage": 1.0 - evidence.coverage,
    }
    values = {name: -math.log(share + _FLOORS[name]) for name, share in misfit.items()}
    # ahead by more than 0.3 is ahead of everything that is not nearly the same pose
    values["margin"] = math.log(min(max(evidence.margin, 0.01), 0.3))
    return np.array([values[name] for name in FEATURES])
