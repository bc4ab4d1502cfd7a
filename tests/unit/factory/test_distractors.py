from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.factory.distractors import build_distractor, hexagon_nut
from boltpose.factory.solids import box, mesh_arrays
from boltpose.factory.spec_fasteners import DistractorKind, DistractorSpec, Site
from tests.unit.factory.small_motor import is_closed


def spec(kind: DistractorKind, size_mm: float = 8, height_mm: float = 3) -> DistractorSpec:
    return DistractorSpec(
        kind=kind, site=Site.YOKE, angle_deg=0, size_mm=size_mm, height_mm=height_mm
    )


@given(
    kind=st.sampled_from(list(DistractorKind)),
    size_mm=st.floats(1.1, 24),
    height_mm=st.floats(0, 19),
)
@settings(max_examples=60, deadline=None)
def test_every_distractor_leaves_one_closed_body(
    kind: DistractorKind, size_mm: float, height_mm: float
) -> None:
    solid = build_distractor(spec(kind, size_mm, height_mm))
    plate = box((80, 80, 60), (0, 0, -30))
    body = plate if solid.cut is None else plate - solid.cut
    body = body if solid.add is None else body + solid.add
    assert is_closed(mesh_arrays(body)[1])
    assert len(body.decompose()) == 1
    for part in (solid.add, solid.cut):
        assert part is None or part.volume() > 0


def test_a_rivet_has_the_volume_of_its_cap() -> None:
    add = build_distractor(spec(DistractorKind.RIVET, 8, 2)).add
    assert add is not None
    above = add.trim_by_plane((0, 0, 1), 0).volume()
    assert above == pytest.approx(math.pi * 2 / 6 * (3 * 16 + 4), rel=0.03)


def test_a_hole_is_as_deep_and_wide_as_it_says() -> None:
    cut = build_distractor(spec(DistractorKind.HOLE, 6, 9)).cut
    assert cut is not None
    x0, _, z0, x1, _, _ = cut.trim_by_plane((0, 0, -1), 1).bounding_box()
    assert (z0, x1 - x0) == pytest.approx((-9, 6))


def test_a_nut_is_as_wide_over_flats_as_it_says() -> None:
    nut = hexagon_nut(10, 5)
    _, y0, z0, _, y1, z1 = nut.bounding_box()
    assert (y1 - y0, z0, z1) == pytest.approx((10, 0, 5))
    assert nut.volume() < 5 * 10**2 * math.sqrt(3) / 2
