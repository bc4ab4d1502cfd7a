from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.factory.layout import lay_out
from boltpose.factory.model import SolidPart
from boltpose.factory.solids import cylinder, manifold_of
from boltpose.factory.spec import (
    CableSpec,
    MotorSpec,
    PlugSpec,
    SolenoidSpec,
    StudSpec,
    TerminalsSpec,
)
from boltpose.factory.terminals import build_terminals
from boltpose.schema import Part
from tests.unit.factory.small_motor import is_closed, volume_mm3


def build(spec: MotorSpec) -> list[SolidPart]:
    return build_terminals(spec, lay_out(spec))


@st.composite
def motors(draw: st.DrawFn) -> MotorSpec:
    has_solenoid = draw(st.booleans())
    solenoid = None
    if has_solenoid:
        solenoid = SolenoidSpec(
            length_mm=draw(st.floats(40, 110)), cap_length_mm=draw(st.floats(10, 30))
        )
    angle = draw(st.floats(0, 360))
    reach = 12 if has_solenoid else 24
    options: dict[str, Any] = {
        "thread_mm": draw(st.sampled_from([5, 6, 8, 10])),
        "nuts": draw(st.integers(0, 2)),
        "bend_deg": draw(st.floats(0, 12)),
        "radius_mm": reach,
    }
    return MotorSpec(
        solenoid=solenoid,
        terminals=TerminalsSpec(
            studs=(
                StudSpec(angle_deg=angle, **options),
                StudSpec(angle_deg=angle + 150, radius_mm=reach),
            ),
            plug=PlugSpec(
                angle_deg=angle + 255,
                kind=draw(st.sampled_from(["box", "blade", "round"])),
                on_side=draw(st.booleans()),
                radius_mm=reach,
            ),
            cable=CableSpec(
                kind=draw(st.sampled_from(["cable", "braid", "bar"])),
                enters=draw(st.sampled_from(["yoke", "rear_cap"])),
                radius_mm=draw(st.floats(2, 5)),
                sag_mm=draw(st.floats(0, 12)),
            ),
        ),
    )


@given(spec=motors())
@settings(max_examples=25, deadline=None)
def test_terminals_are_closed_disjoint_and_named(spec: MotorSpec) -> None:
    parts = build(spec)
    assert len({part.name for part in parts}) == len(parts)
    for part in parts:
        assert part.part is Part.ELECTRICAL_CONNECTOR
        assert part.name.startswith("electrical_connector_")
        assert is_closed(part.faces)
        assert volume_mm3(part) > 0
    bodies = [manifold_of(part) for part in parts]
    for one, other in itertools.combinations(bodies, 2):
        assert (one ^ other).volume() < 0.01


@given(spec=motors())
@settings(max_examples=15, deadline=None)
def test_the_cable_goes_around_yoke_and_solenoid(spec: MotorSpec) -> None:
    layout = lay_out(spec)
    (cable,) = (manifold_of(p) for p in build(spec) if p.name == "electrical_connector_cable")
    yoke = cylinder(spec.housing.radius_mm, layout.yoke_rear_z, 0)
    if spec.solenoid is not None:
        can = cylinder(spec.solenoid.radius_mm, layout.can_rear_z, layout.solenoid_front_z)
        yoke += can.translate((*layout.solenoid_xy, 0))
    # it ends half a millimetre in the yoke, under its grommet
    assert (cable ^ yoke).volume() < 0.04 * cable.volume()


def test_studs_stand_where_their_polar_angles_say() -> None:
    spec = MotorSpec(terminals=TerminalsSpec(studs=(StudSpec(angle_deg=0, nuts=0),), cable=None))
    (stud,) = (p for p in build(spec) if p.name == "electrical_connector_stud_1")
    layout = lay_out(spec)
    low, high = stud.vertices.min(axis=0), stud.vertices.max(axis=0)
    np.testing.assert_allclose(0.5 * (low + high)[:2], (12, layout.solenoid_xy[1]), atol=0.01)
    assert (low[2], high[2]) == pytest.approx((layout.solenoid_rear_z - 20, layout.solenoid_rear_z))


def test_a_bent_stud_leans_outwards_by_its_angle() -> None:
    studs = (StudSpec(angle_deg=0, nuts=0, bend_deg=10),)
    spec = MotorSpec(terminals=TerminalsSpec(studs=studs, cable=None))
    (stud,) = (p for p in build(spec) if p.name == "electrical_connector_stud_1")
    tip = stud.vertices[stud.vertices[:, 2] < stud.vertices[:, 2].min() + 2].mean(axis=0)
    foot = np.array([12, lay_out(spec).solenoid_xy[1], lay_out(spec).solenoid_rear_z])
    lean = np.degrees(np.arctan2(tip[0] - foot[0], foot[2] - tip[2]))
    assert lean == pytest.approx(10, abs=1.5)


def test_without_a_solenoid_they_stand_on_the_rear_cap() -> None:
    studs = (StudSpec(angle_deg=90, radius_mm=22),)
    spec = MotorSpec(solenoid=None, terminals=TerminalsSpec(studs=studs, cable=None))
    (stud,) = (p for p in build(spec) if p.name == "electrical_connector_stud_1")
    assert stud.vertices[:, 2].max() == pytest.approx(lay_out(spec).cap_rear_z)
    assert 0.5 * (stud.vertices[:, 1].min() + stud.vertices[:, 1].max()) == pytest.approx(22, 0.01)
