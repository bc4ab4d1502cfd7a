from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.prior.confidence import (
    RIGHT_MM,
    ConfidenceConfig,
    bolt_probability,
    placement_probability,
)
from boltpose.prior.heads import Head
from boltpose.schema import Side

GOOD = Head(
    side=Side.TOP,
    centre_mm=np.zeros(3),
    fit=None,
    radius_mm=5.0,
    probability=0.9,
    terminal_probability=0.0,
    face_coverage=1.0,
    members=np.arange(100),
    level_sigma_mm=0.05,
)


def probability(head: Head, sigma_mm: float = 0.05) -> float:
    return bolt_probability(head, sigma_mm, ConfidenceConfig())


@pytest.mark.parametrize(
    "worse",
    [
        replace(GOOD, probability=0.4),
        replace(GOOD, radius_mm=2.8),
        replace(GOOD, terminal_probability=0.4),
        replace(GOOD, face_coverage=0.5),
    ],
)
def test_every_doubt_lowers_the_probability(worse: Head) -> None:
    assert 0 < probability(worse) < probability(GOOD) < 1


def test_a_worse_fit_lowers_the_probability() -> None:
    sigmas = [0.03, 0.1, 0.3, 1.0]
    found = [probability(GOOD, sigma) for sigma in sigmas]
    assert found == sorted(found, reverse=True)
    assert found[0] > 0.95


def test_sizes_from_m4_on_are_all_the_same() -> None:
    assert probability(replace(GOOD, radius_mm=3.5)) == probability(replace(GOOD, radius_mm=8.0))


@pytest.mark.parametrize("extreme", [0.0, 1.0])
def test_a_network_that_is_certain_does_not_make_the_bolt_certain(extreme: float) -> None:
    assert 0 < probability(replace(GOOD, probability=extreme)) < 1


def test_the_placement_is_that_of_two_normal_errors() -> None:
    rng = np.random.default_rng(0)
    for sigma in (0.15, 0.3, 0.8):
        off = np.linalg.norm(sigma * rng.standard_normal((40000, 2)), axis=1)
        assert placement_probability(sigma) == pytest.approx((off <= RIGHT_MM).mean(), abs=0.01)


def test_weights_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(ConfigError, match="log_sigma must be finite"):
        ConfidenceConfig(log_sigma=float("nan"))
