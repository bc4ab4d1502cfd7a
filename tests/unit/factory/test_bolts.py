from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from boltpose.errors import ConfigError
from boltpose.factory.bolts import BoltSolid, bolt_clearance, build_bolt, split_bolt
from boltpose.factory.head_sizes import HEAD_SIZES, NUTS, WASHERS
from boltpose.factory.solids import Manifold, cylinder, mesh_arrays
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind, Site

ALL = [(head, thread) for head in HeadKind for thread in (4, 5, 6, 8)]
HEXAGONS = (HeadKind.HEX, HeadKind.HEX_FLANGE)
DRIVES = [head for head in HeadKind if head not in HEXAGONS]


def spec(head: HeadKind = HeadKind.HEX, thread: int = 6, **options: Any) -> BoltSpec:
    return BoltSpec(
        site=Site.REAR_CAP, radius_mm=20, angle_deg=0, head=head, thread_mm=thread, **options
    )


def is_closed(body: Manifold) -> bool:
    _, faces = mesh_arrays(body)
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = ways[:, 0] * (faces.max() + 1) + ways[:, 1]
    back = ways[:, 1] * (faces.max() + 1) + ways[:, 0]
    return len(np.unique(there)) == len(there) and bool((np.sort(there) == np.sort(back)).all())


def slice_box(body: Manifold, z: float) -> tuple[float, float]:
    """Extent along x and y of the cross-section at a height."""
    x0, y0, x1, y1 = body.slice(z).bounds()
    return x1 - x0, y1 - y0


@pytest.mark.parametrize(("head", "thread"), ALL)
def test_a_head_has_the_sizes_of_its_standard(head: HeadKind, thread: int) -> None:
    size = HEAD_SIZES[head][thread]
    bolt = build_bolt(spec(head, thread, shank_mm=15))
    low = np.array(bolt.body.bounding_box()[:3])
    high = np.array(bolt.body.bounding_box()[3:])

    assert (bolt.across_mm, bolt.head_height_mm) == (size.across_mm, size.height_mm)
    assert high[2] == pytest.approx(0, abs=1e-9)
    assert low[2] == pytest.approx(-size.height_mm - 15)
    assert max(high[0] - low[0], high[1] - low[1]) == pytest.approx(bolt.head_diameter_mm, abs=0.01)
    if head in HEXAGONS:
        # in the middle of the hexagon, above a flange, the flats are the spanner size apart
        wide = slice_box(bolt.body, -0.3 * size.height_mm)
        assert wide[1] == pytest.approx(size.across_mm, abs=1e-6)
        assert wide[0] == pytest.approx(size.across_mm / math.cos(math.pi / 6), abs=0.2)
    else:
        assert bolt.head_diameter_mm == size.across_mm
    shank = slice_box(bolt.body, -size.height_mm - 7)
    assert shank == pytest.approx((thread, thread), abs=0.01)


def test_tables_agree_with_the_printed_standards() -> None:
    # ISO 4017, EN 1665, ISO 4762, ISO 14583, ISO 7045, ISO 1207, ISO 7089, ISO 4032
    def row(head: HeadKind, thread: int) -> tuple[float, float]:
        return HEAD_SIZES[head][thread].across_mm, HEAD_SIZES[head][thread].height_mm

    assert [row(HeadKind.HEX, m) for m in (4, 5, 6, 8)] == [(7, 2.8), (8, 3.5), (10, 4), (13, 5.3)]
    assert [row(HeadKind.HEX_FLANGE, m) for m in (5, 6, 8)] == [(8, 5.8), (10, 6.6), (13, 8.1)]
    assert [HEAD_SIZES[HeadKind.HEX_FLANGE][m].flange_mm for m in (5, 6, 8)] == [11.8, 14.2, 18]
    assert [row(HeadKind.SOCKET_CAP, m) for m in (4, 5, 6, 8)] == [
        (7, 4),
        (8.5, 5),
        (10, 6),
        (13, 8),
    ]
    pans = [(8, 3.1), (9.5, 3.7), (12, 4.6), (16, 6)]
    assert [row(HeadKind.TORX_PAN, m) for m in (4, 5, 6, 8)] == pans
    assert [row(HeadKind.PHILLIPS_PAN, m) for m in (4, 5, 6, 8)] == pans
    assert [row(HeadKind.SLOTTED, m) for m in (4, 5, 6, 8)] == [
        (7, 2.6),
        (8.5, 3.3),
        (10, 3.9),
        (13, 5),
    ]
    assert [WASHERS[m].diameter_mm for m in (4, 5, 6, 8)] == [9, 10, 12, 16]
    assert [NUTS[m].across_mm for m in (4, 5, 6, 8, 10)] == [7, 8, 10, 13, 16]


@given(
    head=st.sampled_from(list(HeadKind)),
    thread=st.sampled_from([4, 5, 6, 8]),
    wide=st.floats(0.8, 1.4),
    high=st.floats(0.6, 1.5),
    clogged=st.floats(0, 1),
    dish_mm=st.floats(0, 1.5),
    washer=st.booleans(),
    roll_deg=st.floats(-180, 180),
    shank_mm=st.floats(2, 120),
)
@example(
    head=HeadKind.HEX,
    thread=5,
    wide=0.80078125,
    high=1.0,
    clogged=0.0,
    dish_mm=0.0,
    washer=False,
    roll_deg=0.0,
    shank_mm=2.0,
)
@example(
    head=HeadKind.SOCKET_CAP,
    thread=4,
    wide=1.0,
    high=1.3125,
    clogged=0.9442436721770915,
    dish_mm=0.0,
    washer=False,
    roll_deg=0.0,
    shank_mm=2.0,
)
@settings(max_examples=60, deadline=None)
def test_every_bolt_is_one_closed_body_inside_its_clearance(
    head: HeadKind,
    thread: int,
    wide: float,
    high: float,
    clogged: float,
    dish_mm: float,
    washer: bool,
    roll_deg: float,
    shank_mm: float,
) -> None:
    size = HEAD_SIZES[head][thread]
    wanted = spec(
        head,
        thread,
        across_mm=size.across_mm * max(wide, 1.05 * thread / size.across_mm),
        head_height_mm=size.height_mm * high,
        clogged=clogged,
        dish_mm=dish_mm,
        washer=washer,
        roll_deg=roll_deg,
        shank_mm=shank_mm,
    )
    bolt = build_bolt(wanted)
    assert is_closed(bolt.body)
    assert len(bolt.body.decompose()) == 1
    assert bolt.body.genus() == 0
    assert (bolt.body - bolt_clearance(wanted)).volume() < 1e-3
    assert bolt.body.bounding_box()[5] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("head", DRIVES)
def test_the_drive_loses_volume_in_proportion_to_what_is_open(head: HeadKind) -> None:
    def recess(clogged: float) -> float:
        full = build_bolt(spec(head, clogged=1)).body.volume()
        return full - build_bolt(spec(head, clogged=clogged)).body.volume()

    volumes = [recess(share) for share in (0, 0.25, 0.5, 0.75, 1)]
    assert volumes[-1] == 0
    assert volumes == sorted(volumes, reverse=True)
    assert volumes[0] > 10
    # deeper drives narrow, so half the depth holds at least half of what can be seen
    assert 0.35 < volumes[2] / volumes[0] < 0.75


@pytest.mark.parametrize("head", HEXAGONS)
def test_a_dish_takes_the_frustum_out_of_the_top(head: HeadKind) -> None:
    flat = build_bolt(spec(head))
    dished = build_bolt(spec(head, dish_mm=0.5))
    top = 0.95 * flat.across_mm / 2
    a, b = 0.8 * top, 0.5 * top
    frustum = math.pi * 0.5 / 3 * (a * a + a * b + b * b)
    assert flat.body.volume() - dished.body.volume() == pytest.approx(frustum, rel=0.02)


def test_a_shank_adds_its_cylinder() -> None:
    longer = build_bolt(spec(shank_mm=52)).body - build_bolt(spec(shank_mm=12)).body
    assert longer.volume() == pytest.approx(cylinder(3, 0, 40).volume())


def test_a_washer_lifts_the_head_by_its_thickness() -> None:
    bare, washed = build_bolt(spec()), build_bolt(spec(washer=True))
    assert washed.head_height_mm == bare.head_height_mm + WASHERS[6].thickness_mm
    assert washed.head_diameter_mm == WASHERS[6].diameter_mm


def test_a_roll_turns_the_head_and_nothing_else() -> None:
    turned = build_bolt(spec(roll_deg=25)).body
    plain = build_bolt(spec()).body.rotate((0, 0, 25))
    assert (turned - plain).volume() + (plain - turned).volume() < 1


def test_a_counterbore_is_cleared_up_to_its_rim() -> None:
    deep = spec(recess_mm=14)
    bolt = build_bolt(deep)
    surface = -bolt.head_height_mm + 14
    assert bolt_clearance(deep).bounding_box()[5] > surface + 1


def test_the_clearance_leaves_play_around_shank_and_head() -> None:
    wanted = spec(HeadKind.SOCKET_CAP)
    bolt: BoltSolid = build_bolt(wanted)
    clearance = bolt_clearance(wanted)
    around_shank = slice_box(clearance, -bolt.head_height_mm - 5)[0] - 2 * bolt.shank_radius_mm
    around_head = slice_box(clearance, -1)[0] - bolt.head_diameter_mm
    assert 0.1 <= around_shank / 2 <= 0.3
    assert 0.2 <= around_head / 2 <= 0.6


def test_a_head_narrower_than_its_thread_is_refused() -> None:
    with pytest.raises(ConfigError, match="across_mm of an M8 bolt must be > 8, got 7"):
        build_bolt(spec(thread=8, across_mm=7))


def test_the_same_specification_gives_the_same_bits() -> None:
    first, second = (build_bolt(spec(HeadKind.TORX_PAN, clogged=0.3)) for _ in range(2))
    for one, other in zip(mesh_arrays(first.body), mesh_arrays(second.body), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("shank_mm", "has_rod"), [(12.0, False), (39.0, False), (110.0, True)])
def test_only_through_bolts_are_split_and_nothing_is_lost(shank_mm: float, has_rod: bool) -> None:
    solid = build_bolt(
        BoltSpec(site=Site.REAR_CAP, radius_mm=20, angle_deg=0, shank_mm=shank_mm, washer=True)
    )
    head, rod = split_bolt(solid)
    assert (rod is not None) == has_rod
    if rod is None:
        assert head.volume() == solid.body.volume()
        return
    assert head.volume() + rod.volume() == pytest.approx(solid.body.volume())
    assert head.bounding_box()[5] == pytest.approx(0)
    assert rod.bounding_box()[5] < -solid.head_height_mm
    assert rod.bounding_box()[2] == pytest.approx(-solid.head_height_mm - shank_mm)
