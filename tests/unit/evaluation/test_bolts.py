import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.evaluation.bolts import GATE_MM, match_bolts, measure_bolt_error
from boltpose.geometry.transforms import Transform
from boltpose.schema import Side
from tests.support.strategies import transforms
from tests.unit.evaluation.records import TOPS, prior_bolt, true_bolts

UP = np.array([0.0, 0.0, 1.0])


def test_the_three_errors_are_told_apart() -> None:
    tilted = np.array([0.0, math.sin(0.01), math.cos(0.01)])

    error = measure_bolt_error(np.array([3.0, 4.0, 12.0]), tilted, np.zeros(3), UP)

    assert error.lateral_mm == pytest.approx(5.0)
    assert error.axial_mm == pytest.approx(12.0)
    assert error.axis_rad == pytest.approx(0.01)
    assert error.distance_mm == pytest.approx(13.0)


def test_sliding_along_the_axis_is_no_lateral_error() -> None:
    error = measure_bolt_error(np.array([0.0, 0.0, -2.5]), -UP, np.zeros(3), UP)

    assert error.lateral_mm == 0.0
    assert error.axial_mm == -2.5
    assert error.axis_rad == pytest.approx(math.pi)


@given(
    pose=transforms("base", "prior"),
    offset=st.tuples(*[st.floats(-5, 5)] * 3),
    tilt=st.floats(0, 3),
)
def test_errors_do_not_depend_on_the_frame(
    pose: Transform, offset: tuple[float, ...], tilt: float
) -> None:
    top, found = np.array([1.0, 2, 3]), np.array([1.0, 2, 3]) + offset
    axis = np.array([math.sin(tilt), 0, math.cos(tilt)])

    here = measure_bolt_error(found, axis, top, UP)
    there = measure_bolt_error(
        pose.apply(found), pose.rotate(axis), pose.apply(top), pose.rotate(UP)
    )

    assert there.lateral_mm == pytest.approx(here.lateral_mm, abs=1e-9)
    assert there.axial_mm == pytest.approx(here.axial_mm, abs=1e-9)
    assert there.axis_rad == pytest.approx(here.axis_rad, abs=1e-9)


def test_found_missed_and_false_are_counted() -> None:
    found = [
        prior_bolt("T1", TOPS[0] + (0.3, 0, 0)),
        prior_bolt("T2", TOPS[1] + (0, 0, 4.9), is_sure=False),
        prior_bolt("B1", TOPS[3], Side.TOP),
        prior_bolt("T9", np.array([100.0, 100, 100]), is_sure=False),
    ]

    matching = match_bolts(found, true_bolts())

    assert matching.true_id_of == {"T1": 0, "T2": 1, "B1": 3}
    assert matching.missed == (2,)
    assert [(bolt.found_id, bolt.is_sure) for bolt in matching.false] == [("T9", False)]
    first, second, third = matching.matches
    assert first.error.lateral_mm == pytest.approx(0.3)
    assert second.error.axial_mm == pytest.approx(4.9)
    assert not second.is_sure
    # the head that looks the wrong way is found, with a wrong side and an axis off by pi
    assert not third.is_side_right
    assert third.error.axis_rad == pytest.approx(math.pi)
    assert first.head_diameter_error_mm == pytest.approx(0.5)


def test_one_bolt_found_twice_is_one_match_and_one_false() -> None:
    found = [prior_bolt("T1", TOPS[0] + (1.0, 0, 0)), prior_bolt("T2", TOPS[0] + (0.2, 0, 0))]

    matching = match_bolts(found, true_bolts())

    assert matching.true_id_of == {"T2": 0}
    assert [bolt.found_id for bolt in matching.false] == ["T1"]


def test_the_gate_is_inclusive() -> None:
    inside = match_bolts([prior_bolt("T1", TOPS[0] + (GATE_MM, 0, 0))], true_bolts())
    outside = match_bolts([prior_bolt("T1", TOPS[0] + (GATE_MM + 1e-6, 0, 0))], true_bolts())

    assert inside.true_id_of == {"T1": 0}
    assert outside.matches == ()
    assert outside.missed == (0, 1, 2, 3)


@given(
    seed=st.integers(0, 2**32 - 1),
    found_count=st.integers(0, 5),
    true_count=st.integers(0, 4),
)
def test_no_other_pairing_has_more_pairs_or_as_many_closer(
    seed: int, found_count: int, true_count: int
) -> None:
    tops = np.random.default_rng(seed).uniform(0, 9, size=(found_count, 3))
    true_tops = np.random.default_rng(seed + 1).uniform(0, 9, size=(4, 3))
    truth = [
        dataclasses.replace(bolt, head_top_mm=true_tops[bolt.id])
        for bolt in true_bolts()[:true_count]
    ]
    found = [prior_bolt(f"T{i}", top) for i, top in enumerate(tops)]

    matching = match_bolts(found, truth)

    best = (0, 0.0)
    slots = [*range(true_count), *[None] * found_count]
    for choice in set(itertools.permutations(slots, found_count)):
        pairs = [
            float(np.linalg.norm(top - truth[j].head_top_mm))
            for top, j in zip(tops, choice, strict=True)
            if j is not None
        ]
        if all(distance <= GATE_MM for distance in pairs):
            best = max(best, (len(pairs), -sum(pairs)))
    count = len(matching.matches)
    assert count == best[0]
    assert sum(m.error.distance_mm for m in matching.matches) == pytest.approx(-best[1])
    assert count + len(matching.missed) == true_count
    assert count + len(matching.false) == found_count


def test_a_gate_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="gate_mm must be > 0, got nan"):
        match_bolts([], [], gate_mm=float("nan"))
