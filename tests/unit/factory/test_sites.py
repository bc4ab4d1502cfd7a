"""Every site carries a head on material, with nothing above it."""

from __future__ import annotations

import numpy as np
import pytest

from boltpose.factory.bolts import build_bolt
from boltpose.factory.build import build_motor
from boltpose.factory.layout import lay_out
from boltpose.factory.sites import Body, find_lugs, find_seat, yoke_radius_mm
from boltpose.factory.solids import cylinder, manifold_of, union
from boltpose.factory.spec import (
    BracketSpec,
    GearboxSpec,
    HousingSpec,
    MotorSpec,
    NoseSpec,
    SolenoidSpec,
    TerminalsSpec,
)
from boltpose.factory.spec_fasteners import BoltSpec, DistractorKind, DistractorSpec, HeadKind, Site
from boltpose.schema import Part, Side

BASE = MotorSpec(
    bracket=BracketSpec(
        radius_mm=38,
        body_length_mm=34,
        flange_radius_mm=50,
        nose=NoseSpec(radius_mm=29, tip_radius_mm=26, length_mm=52),
    ),
    solenoid=SolenoidSpec(flange_radius_mm=30),
    terminals=TerminalsSpec(studs=(), plug=None, cable=None),
)

PLACES = [
    BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=200),
    BoltSpec(site=Site.REAR_CAP, radius_mm=42, angle_deg=-20, shank_mm=118),
    BoltSpec(site=Site.REAR_CAP, radius_mm=26, angle_deg=10, recess_mm=4, shank_mm=8),
    BoltSpec(site=Site.GEARBOX_REAR, radius_mm=46, angle_deg=-60, shank_mm=20),
    BoltSpec(site=Site.BRACKET_FRONT, radius_mm=41, angle_deg=-45, recess_mm=3),
    BoltSpec(site=Site.RIM_FRONT, radius_mm=46, angle_deg=0, head=HeadKind.TORX_PAN),
    BoltSpec(site=Site.NOSE_FRONT, radius_mm=19, angle_deg=60, thread_mm=4, shank_mm=6),
    BoltSpec(site=Site.SOLENOID_FRONT, radius_mm=24, angle_deg=15),
    BoltSpec(site=Site.SOLENOID_REAR, radius_mm=33, angle_deg=170, shank_mm=9),
    BoltSpec(site=Site.SOLENOID_CAP, radius_mm=15, angle_deg=90, thread_mm=4),
]


@pytest.mark.parametrize("with_gearbox", [False, True], ids=["direct", "planetary"])
def test_heads_sit_on_material_and_under_free_air(with_gearbox: bool) -> None:
    spec = BASE.model_copy(
        update={"bolts": tuple(PLACES), "gearbox": GearboxSpec() if with_gearbox else None}
    )
    model = build_motor(spec)
    assert len(model.bolts) == len(PLACES)
    others = union([manifold_of(part) for part in model.parts if part.part is not Part.BOLT])
    for bolt in model.bolts:
        pose = bolt.motor_from_bolt.matrix[:3]
        radius, height = 0.5 * bolt.head_diameter_mm, bolt.head_height_mm
        below = cylinder(radius - 0.5, -height - 0.2, -height - 0.02)
        below -= cylinder(0.5 * bolt.spec.thread_mm + 0.3, -height - 1, 0)
        below = below.transform(pose)
        assert (below ^ others).volume() > 0.8 * below.volume(), bolt.spec.site
        around = cylinder(radius + 0.2, -height + 0.01, 4).transform(pose)
        assert (around ^ others).volume() < 1e-6, bolt.spec.site
        end = -height - bolt.spec.shank_mm
        tip = cylinder(0.5 * bolt.spec.thread_mm + 1, end - 0.4, end + 0.4).transform(pose)
        assert (tip ^ others).volume() > 0, f"{bolt.spec.site}: the shank ends in the air"
        assert abs(bolt.axis[2]) == 1
        assert (bolt.side is Side.TOP) == bolt.spec.site.value.endswith("front")


def test_a_recess_moves_the_head_inwards() -> None:
    layout = lay_out(BASE)
    bolt = BoltSpec(site=Site.REAR_CAP, radius_mm=25, angle_deg=0)
    flush = find_seat(BASE, layout, bolt, head_radius_mm=5)
    sunk = find_seat(BASE, layout, bolt, head_radius_mm=5, recess_mm=3)
    assert sunk.centre_mm[2] - flush.centre_mm[2] == pytest.approx(3)
    assert sunk.surface_z == flush.surface_z


def test_a_bolt_beyond_the_rim_gets_a_web() -> None:
    layout = lay_out(BASE)
    for radius, reaches_out in ((20.0, False), (45.0, True)):
        bolt = BoltSpec(site=Site.REAR_CAP, radius_mm=radius, angle_deg=0)
        seat = find_seat(BASE, layout, bolt, head_radius_mm=6)
        lug = find_lugs(BASE, layout, bolt, build_bolt(bolt), seat)[0]
        assert lug.body is Body.REAR_CAP
        assert lug.reaches_out is reaches_out


def test_seats_on_the_yoke_are_radial() -> None:
    spec = BASE.model_copy(update={"housing": HousingSpec(radius_mm=40, ovality_mm=1)})
    item = DistractorSpec(kind=DistractorKind.RIVET, site=Site.YOKE, angle_deg=90, z_mm=20)
    seat = find_seat(spec, lay_out(spec), item, head_radius_mm=3)
    np.testing.assert_allclose(seat.centre_mm, (0, 39.5, -20), atol=1e-9)
    np.testing.assert_allclose(seat.outward, (0, 1, 0), atol=1e-9)
    assert yoke_radius_mm(spec, 0) == pytest.approx(40.5)
