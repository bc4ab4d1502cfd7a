from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.report.markup import Html, clip, data_uri, escape, join, number, percent, tag
from tests.unit.report.conftest import parse

# half characters too: JSON may hold them, and UTF-8 cannot
ANY_TEXT = st.text(st.characters(codec=None), max_size=40)


@given(text=ANY_TEXT)
def test_no_text_can_add_an_element_or_leave_its_attribute(text: str) -> None:
    page = tag("p", text, title=text)

    (paragraph,) = parse(page).all()
    assert set(paragraph.attributes) == {"title"}
    assert paragraph.children == []
    # what a reader sees in both is the same text
    assert " ".join((paragraph.attributes["title"] or "").split()) == paragraph.text
    page.encode()


@given(text=st.text(st.characters(categories=["L", "N", "P", "S"]), max_size=40))
def test_a_text_of_visible_signs_is_shown_as_it_is(text: str) -> None:
    assert "".join(parse(tag("p", text)).all()[0].texts) == text


def test_signs_that_turn_the_direction_of_writing_are_made_visible() -> None:
    assert escape("B1\u202egnp.exe\x00\ud800") == "B1\ufffdgnp.exe\ufffd\ufffd"


def test_html_is_not_escaped_twice_and_none_is_nothing() -> None:
    assert tag("p", tag("b", "<"), None, title=None) == "<p><b>&lt;</b></p>"
    assert join(["<", None, Html("<br>")], " & ") == "&lt; &amp; <br>"


def test_names_of_attributes_are_those_of_html_and_svg() -> None:
    assert tag("rect", class_="a", stroke_width=2, viewBox="0") == (
        '<rect class="a" stroke-width="2" viewBox="0"/>'
    )
    assert tag("meta", name="x") == '<meta name="x">'


def test_bytes_become_an_address() -> None:
    assert data_uri(b"\xff\xfe", "image/jpeg") == "data:image/jpeg;base64,//4="


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.001, "0.00"), (-1.5, "\u22121.50"), (2.345, "2.35"), (float("nan"), "not finite")],
)
def test_numbers_have_a_true_minus_and_no_negative_zero(value: float, text: str) -> None:
    assert number(value, 2) == text


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.9999, "99"), (1.0, "100"), (0.57, "57"), (0.0, "0")],
)
def test_percent_never_rounds_up(share: float, text: str) -> None:
    assert percent(share) == f"{text}\u00a0%"


def test_percent_of_nothing_is_said() -> None:
    assert percent(float("nan")) == "not finite"


def test_clip_keeps_the_length() -> None:
    assert clip("abcdef", 4) == "abc\u2026"
    assert clip("abcd", 4) == "abcd"
