from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError, ShapeError
from boltpose.geometry.transforms import Transform
from boltpose.registration.bolt_state import BoltJudgement, BoltStateConfig, judge_bolts
from boltpose.schema import BoltState
from tests.unit.registration.scenes import (
    BOLTS,
    HEAD_HEIGHT_MM,
    HEAD_RADIUS_MM,
    back_wall,
    box,
    cylinder,
    pose,
    prepared_motor,
    surface,
)

LOOKS_AT_TOP = pose(turn=(np.pi - 0.5, 0.1, 0.2))
Surface = tuple[np.ndarray, np.ndarray]


def head(name: str, *, height: float = HEAD_HEIGHT_MM, radius: float = HEAD_RADIUS_MM) -> Surface:
    (x, y, top), _ = BOLTS[name]
    seat = top - HEAD_HEIGHT_MM
    return cylinder(radius, (seat, seat + height), (x, y), 0.5)


def scan(
    camera_from_prior: Transform, *, without: str | None = None, put: tuple[Surface, ...] = ()
) -> np.ndarray:
    """What a camera sees of the motor without one head and with other things, before a wall."""
    points, normals, _ = surface(0.5)
    if without is not None:
        (x, y, top), _ = BOLTS[without]
        beside = np.hypot(points[:, 0] - x, points[:, 1] - y)
        gone = (beside < HEAD_RADIUS_MM + 0.1) & (points[:, 2] > top - HEAD_HEIGHT_MM + 0.1)
        points, normals = points[~gone], normals[~gone]
    points = camera_from_prior.apply(np.vstack([points, *(part[0] for part in put)]))
    normals = camera_from_prior.rotate(np.vstack([normals, *(part[1] for part in put)]))
    points = points[np.einsum("ni,ni->n", points, normals) < 0]
    points = np.vstack([points, back_wall(900.0)])
    cell = np.floor(points[:, :2] / points[:, 2:] / 0.0015).astype(np.int64)
    cell -= cell.min(axis=0)
    flat = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    front = np.full(flat.max() + 1, np.inf)
    np.minimum.at(front, flat, points[:, 2])
    seen = points[points[:, 2] < front[flat] + 1.5]
    return seen * (1 + np.random.default_rng(0).normal(scale=1e-4, size=(len(seen), 1)))


def judge(
    points: np.ndarray, camera_from_prior: Transform = LOOKS_AT_TOP
) -> dict[str, BoltJudgement]:
    judged = judge_bolts(prepared_motor(), camera_from_prior, points)
    assert [one.bolt_id for one in judged] == list(BOLTS)
    return {one.bolt_id: one for one in judged}


def test_heads_in_view_are_confirmed_and_hidden_ones_unseen() -> None:
    judged = judge(scan(LOOKS_AT_TOP))

    assert {name: one.state for name, one in judged.items()} == {
        "T1": BoltState.CONFIRMED,
        "T2": BoltState.CONFIRMED,
        "B1": BoltState.UNSEEN,
    }
    assert all(one.reason == "" for one in judged.values())


def test_a_missing_head_contradicts_and_leaves_the_others_alone() -> None:
    judged = judge(scan(LOOKS_AT_TOP, without="T1"))

    assert judged["T1"].state is BoltState.CONTRADICTED
    assert "missing screw" in judged["T1"].reason
    assert judged["T1"].sight.through_share > 0.9
    assert judged["T2"].state is BoltState.CONFIRMED


@pytest.mark.parametrize("change", [{"height": 6.0}, {"height": 2.5}, {"radius": 3.5}])
def test_another_head_contradicts(change: dict[str, float]) -> None:
    judged = judge(scan(LOOKS_AT_TOP, without="T1", put=(head("T1", **change),)))

    assert judged["T1"].state is BoltState.CONTRADICTED
    assert "another head" in judged["T1"].reason
    assert judged["T2"].state is BoltState.CONFIRMED


@pytest.mark.parametrize("shift", [(0, 0, 0.3), (0, 0, -0.3), (0.3, 0, 0), (0, -0.3, 0)])
def test_the_error_of_a_good_pose_does_not_contradict(shift: tuple[float, float, float]) -> None:
    moved = Transform.from_parts("camera", "camera", np.eye(3), shift) @ LOOKS_AT_TOP

    judged = judge(scan(LOOKS_AT_TOP), moved)

    assert judged["T1"].state is judged["T2"].state is BoltState.CONFIRMED


def test_dirt_on_a_head_does_not_contradict() -> None:
    judged = judge(scan(LOOKS_AT_TOP, put=(head("T1", height=HEAD_HEIGHT_MM + 0.2),)))

    assert judged["T1"].state is BoltState.CONFIRMED


@pytest.mark.parametrize("gap_mm", [1.0, 3.0, 8.0])
def test_a_strap_over_a_head_hides_it_and_does_not_contradict(gap_mm: float) -> None:
    (x, y, top), _ = BOLTS["T1"]
    strap = box((x - 40, y - 14, top + gap_mm), (x + 40, y + 14, top + gap_mm + 2), 0.5)

    judged = judge(scan(LOOKS_AT_TOP, put=(strap,)))

    assert judged["T1"].state is BoltState.UNSEEN


def test_a_head_that_was_not_measured_is_unseen() -> None:
    points = scan(LOOKS_AT_TOP)
    centre = LOOKS_AT_TOP.apply(np.array(BOLTS["T1"][0]))
    rays = points[:, :2] / points[:, 2:]
    dark = np.linalg.norm(rays - centre[:2] / centre[2], axis=1) * centre[2] < 12.0

    assert judge(points[~dark])["T1"].state is BoltState.UNSEEN
    assert {one.state for one in judge(np.zeros((0, 3))).values()} == {BoltState.UNSEEN}


def test_the_order_of_the_points_does_not_matter() -> None:
    points = scan(LOOKS_AT_TOP, without="T1", put=(head("T1", height=6.0),))
    order = np.random.default_rng(3).permutation(len(points))

    assert judge(points) == judge(points[order])


def test_points_behind_the_camera_are_passed_over() -> None:
    points = scan(LOOKS_AT_TOP)

    assert judge(np.vstack([points, -points, 0 * points[:3]])) == judge(points)


def test_a_scan_that_is_none_is_refused() -> None:
    with pytest.raises(ShapeError):
        judge_bolts(prepared_motor(), LOOKS_AT_TOP, np.zeros((4, 2)))


@pytest.mark.parametrize(
    ("field", "value"),
    [("beam_mm", 0.0), ("through_share", 1.0), ("min_points", 2), ("max_around_share", -0.1)],
)
def test_settings_out_of_range_are_refused(field: str, value: float) -> None:
    with pytest.raises(ConfigError, match=field):
        replace(BoltStateConfig(), **{field: value})
