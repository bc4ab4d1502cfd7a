from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import ConfigError
from boltpose.prior.review_words import (
    MAX_WORDS,
    clean_words,
    name_bolt,
    set_order,
    set_orders,
    set_tool,
)
from boltpose.schema import Prior
from tests.support import records


@pytest.fixture(scope="module")
def prior() -> Prior:
    return records.prior(*(records.prior_bolt(f"T{k}", seed=k) for k in (1, 2, 3)))


def test_words_are_kept_and_touch_nothing_else(prior: Prior) -> None:
    named = set_tool(name_bolt(prior, "T2", " solenoid  upper "), ["T2"], "Torx E12")
    assert (named.bolt("T2").name, named.bolt("T2").tool) == ("solenoid upper", "Torx E12")
    assert named.bolt("T1") is prior.bolt("T1")
    assert named.bolt("T2").prior_from_bolt is prior.bolt("T2").prior_from_bolt
    assert name_bolt(named, "T2", "").bolt("T2").name == ""


@pytest.mark.parametrize("taken", ["nose", "NOSE", " nose "])
def test_no_two_bolts_have_one_name(prior: Prior, taken: str) -> None:
    named = name_bolt(prior, "T1", "nose")
    with pytest.raises(ConfigError, match="bolt T1 is already called 'nose'"):
        name_bolt(named, "T2", taken)
    assert name_bolt(named, "T1", "Nose").bolt("T1").name == "Nose"


def test_no_bolt_is_called_like_the_id_of_another(prior: Prior) -> None:
    with pytest.raises(ConfigError, match="'t3' is the id of another bolt"):
        name_bolt(prior, "T1", "t3")
    assert name_bolt(prior, "T1", "T1").bolt("T1").name == "T1"


@pytest.mark.parametrize("bad", ["a\nb", "a\x00", "\u202eabc", "a\u200bb", "\ud800", "a\u2028"])
def test_what_does_not_print_is_refused(prior: Prior, bad: str) -> None:
    with pytest.raises(ConfigError, match="printable characters only"):
        name_bolt(prior, "T1", bad)
    with pytest.raises(ConfigError, match="printable characters only"):
        set_tool(prior, ["T1"], bad)


def test_long_words_are_refused(prior: Prior) -> None:
    assert set_tool(prior, ["T1"], "x" * MAX_WORDS).bolt("T1").tool == "x" * MAX_WORDS
    with pytest.raises(ConfigError, match="at most 60 characters, got 61"):
        set_tool(prior, ["T1"], "x" * (MAX_WORDS + 1))


@given(text=st.text())
def test_cleaning_twice_is_cleaning_once(text: str) -> None:
    try:
        once = clean_words(text, "a name")
    except ConfigError:
        return
    assert clean_words(once, "a name") == once
    assert once.isprintable()
    assert len(once) <= MAX_WORDS


@given(orders=st.dictionaries(st.sampled_from(["T1", "T2", "T3"]), st.none() | st.integers(-2, 5)))
def test_turns_are_unique_and_positive_or_refused(orders: dict[str, int | None]) -> None:
    prior = records.prior(*(records.prior_bolt(f"T{k}", seed=k) for k in (1, 2, 3)))
    given_turns = [order for order in orders.values() if order is not None]
    fits = len(set(given_turns)) == len(given_turns) and all(turn >= 1 for turn in given_turns)
    if not fits:
        with pytest.raises(ConfigError, match="turn"):
            set_orders(prior, orders)
        return
    after = set_orders(prior, orders)
    assert {bolt.id: bolt.order for bolt in after.bolts} == {
        "T1": None, "T2": None, "T3": None, **orders,
    }  # fmt: skip


def test_two_bolts_change_turns_at_once_but_not_one_after_the_other(prior: Prior) -> None:
    both = set_orders(prior, {"T1": 1, "T2": 2})
    with pytest.raises(ConfigError, match="T1 and T2 would both have turn 2"):
        set_order(both, "T1", 2)
    swapped = set_orders(both, {"T1": 2, "T2": 1})
    assert (swapped.bolt("T1").order, swapped.bolt("T2").order) == (2, 1)


@pytest.mark.parametrize("bad", [0, -1, 1000, True, 1.0])
def test_a_turn_is_a_number_from_1(prior: Prior, bad: object) -> None:
    with pytest.raises(ConfigError, match="turn of T1 must be 1 to 999"):
        set_orders(prior, {"T1": bad})  # pyright: ignore[reportArgumentType]


def test_an_unknown_bolt_is_named_with_those_there_are(prior: Prior) -> None:
    for change in (
        lambda: name_bolt(prior, "X", "a"),
        lambda: set_tool(prior, ["X"], "a"),
        lambda: set_order(prior, "X", 1),
    ):
        with pytest.raises(ConfigError, match=r"no bolt 'X' in prior 'motor', there are \['T1'"):
            change()
