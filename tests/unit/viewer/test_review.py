from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("viser", reason="the page needs the extra `viewer`")

from boltpose.prior.review_edits import ConfirmBolt, SetTool
from boltpose.schema import Prior, Side
from boltpose.viewer.review_texts import (
    bolt_card,
    bolt_table,
    choices,
    edit_words,
    headline,
    measured_words,
)
from boltpose.viewer.review_view import look_from
from tests.support import records


@pytest.fixture
def prior() -> Prior:
    evil = replace(records.prior_bolt("T1"), name="<b>&\u202e", tool="<script>")
    return records.prior(evil, records.prior_bolt("B1", seed=2, is_sure=False))


def test_the_headline_counts_what_is_left(prior: Prior) -> None:
    assert "1 to check" in headline(prior, state="saved", is_adding=False)
    sure = replace(prior, bolts=prior.bolts[:1])
    assert "All sure" in headline(sure, state="saved", is_adding=False)
    assert "CLICK" in headline(sure, state="saved", is_adding=True)


def test_an_unsure_bolt_says_why(prior: Prior) -> None:
    card = bolt_card(prior, "B1")
    assert "Unsure: confidence 90" in card
    assert "little flank." in card
    assert "Unsure" not in bolt_card(prior, "T1")
    assert "No bolt is chosen" in bolt_card(prior, None)


def test_names_cannot_break_the_page(prior: Prior) -> None:
    for html in (bolt_card(prior, "T1"), bolt_table(prior, "T1")):
        assert "<script>" not in html
        assert "<b>&" not in html
        assert "\u202e" not in html


def test_every_bolt_can_be_chosen_and_unsure_ones_come_first(prior: Prior) -> None:
    assert list(choices(prior).values()) == ["B1", "T1"]


def test_a_badly_measured_head_is_never_announced_as_good(prior: Prior) -> None:
    assert measured_words(prior.bolts[0])[0]
    is_good, text = measured_words(prior.bolts[1])
    assert not is_good
    assert "unsure: little flank" in text


def test_edits_are_named_by_their_bolts() -> None:
    assert edit_words(ConfirmBolt(bolt="T1")) == "confirm T1"
    assert edit_words(SetTool(bolts=("T1", "T2"), tool="x")) == "tool of 2 bolts"


@pytest.mark.parametrize("side", list(Side))
def test_the_viewer_stands_before_the_head_and_nothing_in_between(side: Side) -> None:
    bolt = replace(records.prior_bolt("T1"), side=side)
    pose = bolt.prior_from_bolt
    # a wall all around the head, open to one side
    angles = np.linspace(0.0, 2 * np.pi, 400)
    angles = angles[np.abs(angles - np.pi) > 0.6]
    wall = [
        (60 * np.cos(a), 60 * np.sin(a), z) for a in angles for z in np.linspace(40.0, 130.0, 30)
    ]
    prior = replace(records.prior(bolt), points=pose.apply(np.array(wall)))

    x, y, z = pose.inverse().apply(look_from(prior, bolt))

    assert z > 0
    assert x < 0
    assert abs(y) < abs(x)
