"""The probability that a measured head is a bolt, from all the evidence, and rightly placed."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from boltpose.errors import ConfigError
from boltpose.prior.heads import Head

RIGHT_MM = 0.5
"""A bolt is rightly placed up to this far beside its true axis: what a socket forgives."""
_CLIP = 0.02
"""Class probabilities nearer to 0 or 1 than this say nothing more: networks overstate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceConfig:
    """A logistic model of whether a head is a bolt: weights of the log odds.

    Fitted on the candidates of 42 motors of the factory (`boltpose synth`) by networks that were
    trained on 240 others; reman18 took no part. `python -m boltpose.training.bolt_confidence`
    minimises the same loss from the scans on; it has been run on 4 motors only.
    """

    constant: float = -0.8
    class_log_odds: float = 1.6
    """Per unit of the log odds of the head's mean bolt probability."""
    log_sigma: float = -0.9
    """Per factor e of the lateral sigma, in units of 0.1 mm: other surfaces fit badly."""
    small_per_mm: float = -3.5
    """Per mm that the radius stays below `small_radius_mm`."""
    small_radius_mm: float = 3.25
    """A little less than half the spanner size of M4, the smallest bolt on a starter motor."""
    terminal: float = -0.8
    """Per unit of the mean probability of class electrical connector, whose nuts look alike."""
    unseen_face: float = -4.1
    """Per share of the turn in which no top face was seen."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            if not math.isfinite(getattr(self, entry.name)):
                raise ConfigError(f"{entry.name} must be finite, got {getattr(self, entry.name)}")


def describe_head(
    head: Head, sigma_lateral_mm: float, small_radius_mm: float
) -> tuple[float, float, float, float, float, float]:
    """What the model weighs, in the order of its weights; the first is 1."""
    probability = min(max(head.probability, _CLIP), 1 - _CLIP)
    return (
        1.0,
        math.log(probability / (1 - probability)),
        math.log(sigma_lateral_mm / 0.1),
        max(0.0, small_radius_mm - head.radius_mm),
        head.terminal_probability,
        1.0 - head.face_coverage,
    )


def bolt_probability(head: Head, sigma_lateral_mm: float, config: ConfidenceConfig) -> float:
    """Probability, 0 to 1, that a head is a bolt's.

    Args:
        head: The measured head.
        sigma_lateral_mm: 1 sigma of its place beside the axis.
        config: The model.
    """
    weights = (
        config.constant,
        config.class_log_odds,
        config.log_sigma,
        config.small_per_mm,
        config.terminal,
        config.unseen_face,
    )
    evidence = describe_head(head, sigma_lateral_mm, config.small_radius_mm)
    odds = sum(weight * value for weight, value in zip(weights, evidence, strict=True))
    return 1.0 / (1.0 + math.exp(-max(min(odds, 30.0), -30.0)))


def placement_probability(sigma_lateral_mm: float, reach_mm: float = RIGHT_MM) -> float:
    """Probability, 0 to 1, that a place known to 1 sigma is off by at most `reach_mm`.

    Source:
        Rayleigh distribution: two independent normal errors across the axis.
    """
    return 1.0 - math.exp(-0.5 * (reach_mm / sigma_lateral_mm) ** 2)
