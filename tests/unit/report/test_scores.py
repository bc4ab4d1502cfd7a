from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.registration.config import VerifyConfig
from boltpose.registration.evidence import Evidence
from boltpose.registration.verify import decide
from boltpose.report.advice import ADVICE
from boltpose.report.scores import (
    AT_LEAST,
    AT_MOST,
    Score,
    missed_although_ok,
    score_section,
    scores_of,
)
from boltpose.schema import Check, Status
from tests.unit.report.conftest import parse

GOOD = Evidence(
    motor_points=6000,
    free_space_violation=0.0,
    explained=0.98,
    tight=0.995,
    weakest_tight=0.99,
    sunk=0.0,
    coverage=0.95,
    judged_points=8000,
    measured=0.97,
    margin=0.5,
    bolt_sigma_mm=0.1,
    converged=True,
)
BAD = Evidence(
    motor_points=1,
    free_space_violation=0.9,
    explained=0.01,
    tight=0.01,
    weakest_tight=0.01,
    sunk=0.9,
    coverage=0.01,
    judged_points=1,
    measured=0.01,
    margin=0.0,
    bolt_sigma_mm=9.0,
    converged=False,
)


def test_the_sides_are_those_of_the_verdict() -> None:
    verdict = decide(BAD, VerifyConfig())

    sentences = " ".join(verdict.reasons)
    sides = re.findall(r"wanted at (most|least)", sentences)
    single = [name for name in verdict.thresholds if name != "p_correct"]
    assert len(sides) == len(single)
    for name, side in zip(single, sides, strict=True):
        assert name in (AT_MOST if side == "most" else AT_LEAST)
    assert "p_correct" in AT_LEAST
    # those of several views and of many motors, from joint_verdict.py and variant_search.py
    assert set(verdict.thresholds) | {"views_apart_sigmas", "variant_lead"} == AT_MOST | AT_LEAST


def test_met_is_what_the_verdict_says_met() -> None:
    good = decide(GOOD, VerifyConfig())
    assert good.status is Status.OK
    assert missed_although_ok(good) == []
    for name in good.thresholds:
        if name == "p_correct":
            continue
        verdict = decide(replace(GOOD, **{name: getattr(BAD, name)}), VerifyConfig())
        assert [s.name for s in scores_of(verdict) if s.is_met is False][:1] == [name]


@given(
    name=st.sampled_from(sorted(AT_LEAST | AT_MOST)),
    value=st.floats(-10, 1e5),
    threshold=st.floats(0.001, 1e4),
)
def test_right_of_the_middle_is_good_and_nowhere_else(
    name: str, value: float, threshold: float
) -> None:
    score = Score(name=name, value=value, threshold=threshold)
    assert score.goodness is not None
    assert 0 <= score.goodness <= 1
    if score.is_met:
        assert score.goodness >= 0.5
    else:
        assert score.goodness <= 0.5


@given(low=st.floats(0, 2), more=st.floats(0, 2), threshold=st.floats(0.01, 1))
def test_a_better_value_is_never_further_left(low: float, more: float, threshold: float) -> None:
    for name in ("tight", "free_space_violation"):
        first, second = (
            Score(name=name, value=value, threshold=threshold).goodness
            for value in (low, low + more)
        )
        assert first is not None
        assert second is not None
        assert second >= first if name == "tight" else second <= first


@pytest.mark.parametrize(("value", "threshold"), [(None, 0.5), (0.5, None)])
def test_what_was_not_measured_is_neither_met_nor_missed(
    value: float | None, threshold: float | None
) -> None:
    score = Score(name="tight", value=value, threshold=threshold)
    assert score.is_met is None
    assert score.goodness is None


def test_not_a_number_is_never_good() -> None:
    score = Score(name="tight", value=math.nan, threshold=0.5)
    assert score.is_met is False
    assert score.goodness == 0


def test_a_score_nobody_knows_has_no_side() -> None:
    assert Score(name="surprise", value=1.0, threshold=0.5).is_met is None


def test_every_score_stands_in_the_section_with_a_word_beside_its_bar() -> None:
    verdict = decide(replace(GOOD, tight=0.9), VerifyConfig())
    section = parse(score_section(verdict))

    rows = [row for row in section.all("tr") if row.all("td")]
    assert [row.all("th")[0].attributes["title"] for row in rows] == list(verdict.thresholds)
    (missed,) = section.all("tr", "missed")
    assert missed.all("svg")[0].attributes["aria-label"] == "missed"
    assert "0.9000" in missed.text
    assert "\u2265 0.9400" in missed.text.replace("\u00a0", " ")
    words = [row.all("svg")[0].attributes["aria-label"] for row in rows if row is not missed]
    assert set(words) == {"met"}
    assert "felt least 0.9900" in section.text


def test_every_reason_code_has_a_meaning_and_something_to_do() -> None:
    assert set(ADVICE) == set(Check)
    assert len({advice.todo for advice in ADVICE.values()}) == len(Check)
