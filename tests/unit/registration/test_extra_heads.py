from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.registration.extra_heads import ExtraHeadConfig, find_extra_heads
from tests.unit.registration.scenes import box, cylinder, prepared_motor
from tests.unit.registration.test_bolt_state import LOOKS_AT_TOP, scan

TOP = (-2.0, 22.0, 54.5)
SURPLUS = cylinder(4.5, (50.0, TOP[2]), TOP[:2], 0.5)


def test_a_surplus_head_is_found_where_it_is() -> None:
    (found,) = find_extra_heads(prepared_motor(), LOOKS_AT_TOP, scan(LOOKS_AT_TOP, put=(SURPLUS,)))

    assert np.linalg.norm(found.head_top_mm - LOOKS_AT_TOP.apply(np.array(TOP))) < 0.7
    assert found.diameter_mm == pytest.approx(9.0, abs=1.0)
    assert found.height_mm == pytest.approx(4.5, abs=1.0)


def test_the_order_of_the_points_does_not_matter() -> None:
    points = scan(LOOKS_AT_TOP, put=(SURPLUS,))
    order = np.random.default_rng(1).permutation(len(points))

    (one,) = find_extra_heads(prepared_motor(), LOOKS_AT_TOP, points)
    (other,) = find_extra_heads(prepared_motor(), LOOKS_AT_TOP, points[order])

    assert np.array_equal(one.head_top_mm, other.head_top_mm)
    assert (one.diameter_mm, one.height_mm) == (other.diameter_mm, other.height_mm)


@pytest.mark.parametrize(
    "thing",
    [
        None,
        box((-14.0, 20.0, 50.0), (20.0, 25.0, 54.0), 0.5),
        box((-4.0, 20.0, 50.0), (10.0, 24.0, 54.0), 0.5),
        cylinder(2.0, (50.0, 54.0), TOP[:2], 0.5),
        cylinder(4.5, (50.0, 51.2), TOP[:2], 0.5),
    ],
    ids=["nothing", "cable", "lug", "pin", "patch of dirt"],
)
def test_what_is_no_head_is_not_reported(thing: tuple[np.ndarray, np.ndarray] | None) -> None:
    points = scan(LOOKS_AT_TOP, put=() if thing is None else (thing,))

    assert find_extra_heads(prepared_motor(), LOOKS_AT_TOP, points) == ()


def test_another_head_on_a_known_bolt_is_no_surplus_one() -> None:
    taller = cylinder(5.0, (50.0, 57.5), (22.0, 12.0), 0.5)

    points = scan(LOOKS_AT_TOP, without="T1", put=(taller,))

    assert find_extra_heads(prepared_motor(), LOOKS_AT_TOP, points) == ()


def test_an_empty_scan_has_none() -> None:
    assert find_extra_heads(prepared_motor(), LOOKS_AT_TOP, np.zeros((0, 3))) == ()


@pytest.mark.parametrize(
    ("field", "value"),
    [("unknown_mm", 0.0), ("diameter_mm", (9.0, 5.0)), ("min_face_share", 1.5), ("min_points", 3)],
)
def test_settings_out_of_range_are_refused(field: str, value: float | tuple[float, float]) -> None:
    with pytest.raises(ConfigError, match=field):
        replace(ExtraHeadConfig(), **{field: value})
