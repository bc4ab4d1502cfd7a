import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.evaluation.codec import decode, encode


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, kw_only=True)
class Inner:
    value: float
    name: str


@dataclass(frozen=True, kw_only=True)
class Outer:
    colour: Colour
    inner: Inner | None
    many: tuple[Inner, ...]
    numbers: Mapping[str, float]
    is_on: bool
    count: int


inners = st.builds(Inner, value=st.floats(allow_nan=False, allow_infinity=False), name=st.text())
outers = st.builds(
    Outer,
    colour=st.sampled_from(Colour),
    inner=st.none() | inners,
    many=st.lists(inners).map(tuple),
    numbers=st.dictionaries(st.text(), st.floats(allow_nan=False, allow_infinity=False)),
    is_on=st.booleans(),
    count=st.integers(),
)


@given(record=outers)
def test_what_was_written_is_read(record: Outer) -> None:
    assert decode(Outer, json.loads(json.dumps(encode(record)))) == record


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": "3"}, "Outer.count must be int, got str"),
        ({"count": True}, "Outer.count must be int, got bool"),
        ({"many": {}}, "Outer.many must be a list, got dict"),
        ({"inner": 3}, "Outer.inner must be an object, got int"),
        ({"inner": {"value": 1.0}}, r"Outer.inner must have the fields .* differs by \['name'\]"),
        ({"extra": 1}, r"Outer must have the fields .* differs by \['extra'\]"),
        ({"colour": "green"}, "'green' is not a valid Colour"),
    ],
)
def test_anything_unexpected_is_an_error(change: dict[str, object], message: str) -> None:
    record = Outer(colour=Colour.RED, inner=None, many=(), numbers={}, is_on=True, count=1)
    with pytest.raises(ValueError, match=message):
        decode(Outer, encode(record) | change)


def test_arrays_do_not_slip_into_records() -> None:
    with pytest.raises(TypeError, match="ndarray has no JSON form"):
        encode({"points": np.zeros(3)})
