"""Stations of a motor."""

from __future__ import annotations

import numpy as np
import pytest

from boltpose.factory.layout import cap_back_z, lay_out
from boltpose.factory.spec import (
    BracketSpec,
    GearboxSpec,
    HousingSpec,
    MotorSpec,
    NoseSpec,
    RearCapSpec,
)


def test_stations_follow_each_other_along_the_axis() -> None:
    spec = MotorSpec(
        housing=HousingSpec(length_mm=90),
        rear_cap=RearCapSpec(length_mm=12, hub_height_mm=5),
        gearbox=GearboxSpec(length_mm=24),
        bracket=BracketSpec(
            body_length_mm=22, flange_mm=10, nose=NoseSpec(length_mm=50, tip_boss_mm=4)
        ),
    )
    layout = lay_out(spec)
    assert layout.yoke_rear_z == -90
    assert layout.cap_rear_z == -102
    assert layout.hub_rear_z == -107
    assert layout.bracket_rear_z == 24
    assert layout.flange_rear_z == 36
    assert layout.flange_front_z == 46
    assert layout.nose_front_z == 96
    assert layout.nose_tip_z == 100
    assert (layout.rear_z, layout.front_z) == (-107, 100)
    middle = layout.motor_from_build.apply([[0, 0, -3.5]])
    np.testing.assert_allclose(middle, 0, atol=1e-12)


def test_a_free_pinion_is_the_foremost_part() -> None:
    nose = NoseSpec(style="stub", length_mm=8)
    layout = lay_out(MotorSpec(bracket=BracketSpec(nose=nose)))
    assert layout.shaft_tip_z > layout.nose_tip_z
    assert layout.front_z == layout.shaft_tip_z


def test_an_offset_gear_moves_the_shaft_and_nothing_else() -> None:
    plain = lay_out(MotorSpec(gearbox=GearboxSpec()))
    offset = lay_out(MotorSpec(gearbox=GearboxSpec(shaft_offset_mm=30, shaft_angle_deg=90)))
    assert plain.shaft_xy == (0, 0)
    assert offset.shaft_xy == pytest.approx((0, 30))
    assert plain.flange_front_z == offset.flange_front_z


def test_terminals_stand_on_the_rear_cap_of_a_motor_without_solenoid() -> None:
    spec = MotorSpec(solenoid=None)
    layout = lay_out(spec)
    assert layout.terminal_xy == (0, 0)
    assert layout.terminal_z(spec) == layout.cap_rear_z
    assert layout.rear_z == layout.hub_rear_z


@pytest.mark.parametrize("style", ["flat", "domed", "stepped", "spider"])
def test_a_cap_never_rises_outwards(style: str) -> None:
    spec = MotorSpec(rear_cap=RearCapSpec.model_validate({"style": style}))
    layout = lay_out(spec)
    heights = [cap_back_z(spec, layout, radius) for radius in np.linspace(0, 37, 40)]
    assert heights[0] == layout.cap_rear_z
    assert (np.diff(heights) >= 0).all()
    assert max(heights) < layout.yoke_rear_z
