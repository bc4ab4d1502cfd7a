import math
from dataclasses import fields, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import ConfigError
from boltpose.registration.evidence import Evidence
from boltpose.registration.probability import features, probability_correct
from boltpose.registration.probability_config import FEATURES, ProbabilityConfig

GOOD = Evidence(
    motor_points=5000,
    free_space_violation=0.0,
    explained=0.99,
    tight=0.996,
    weakest_tight=0.99,
    sunk=0.0005,
    coverage=0.93,
    judged_points=8000,
    measured=0.97,
    margin=0.5,
    bolt_sigma_mm=0.12,
    converged=True,
)
MORE_IS_BETTER = ("tight", "weakest_tight", "coverage", "margin")
LESS_IS_BETTER = ("free_space_violation", "sunk")
shares = st.floats(0.0, 1.0)


@st.composite
def evidences(draw: st.DrawFn) -> Evidence:
    return replace(GOOD, **{name: draw(shares) for name in (*MORE_IS_BETTER, *LESS_IS_BETTER)})


@given(evidence=evidences(), better=shares, name=st.sampled_from(MORE_IS_BETTER + LESS_IS_BETTER))
def test_better_evidence_never_lowers_the_probability(
    evidence: Evidence, better: float, name: str
) -> None:
    other = replace(evidence, **{name: better})
    is_better = (better >= getattr(evidence, name)) == (name in MORE_IS_BETTER)
    first, second = probability_correct(evidence), probability_correct(other)

    assert first <= second if is_better else second <= first


@given(evidence=evidences())
def test_nobody_claims_certainty(evidence: Evidence) -> None:
    assert 0.0 <= probability_correct(evidence) <= ProbabilityConfig().highest < 1.0


def test_the_shipped_weights_tell_a_good_pose_from_a_slid_one() -> None:
    slid = replace(GOOD, tight=0.83, weakest_tight=0.27, coverage=0.68)

    assert probability_correct(GOOD) > 0.9
    assert probability_correct(slid) < 0.1


def test_every_feature_has_a_weight_and_a_value() -> None:
    assert set(FEATURES) <= {field.name for field in fields(ProbabilityConfig)}
    assert len(features(GOOD)) == len(FEATURES)


def test_a_number_that_could_not_be_measured_is_no_evidence() -> None:
    assert probability_correct(replace(GOOD, weakest_tight=math.nan)) == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tight": -0.1}, "weight tight must be >= 0, got -0.1"),
        ({"sunk": math.nan}, "weight sunk must be >= 0, got nan"),
        ({"bias": math.inf}, "bias must be finite, got inf"),
        ({"highest": 1.0}, "highest must lie between 0 and 1, got 1.0"),
    ],
)
def test_weights_that_make_no_sense_are_refused(change: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ProbabilityConfig(**change)
