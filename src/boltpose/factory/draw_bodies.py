"""Draws the bodies of a motor of one family: everything but bolts and distractors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from boltpose.factory.draw_terminals import draw_terminals
from boltpose.factory.draws import angle_apart_deg, between, happens, one_of, whole
from boltpose.factory.gear import tooth_radii
from boltpose.factory.plans import FamilyPlan
from boltpose.factory.solids import polar
from boltpose.factory.spec import (
    BracketSpec,
    EarSpec,
    GearboxSpec,
    GearSpec,
    HousingSpec,
    MotorSpec,
    NoseSpec,
    RearCapSpec,
    SolenoidSpec,
)

_COLLAR_ASPECT = (0.25, 0.85)
"""Length of a collar around a free pinion, in its radii."""
_FREE_DEG = 42
"""Ears keep this far from the direction of the solenoid, mounting tools need it."""


def draw_bodies(rng: np.random.Generator, plan: FamilyPlan) -> MotorSpec:
    """Draw a motor of a family, without bolts and distractors, solenoid above, not mirrored."""
    housing = _housing(rng, plan)
    gear = _gear(rng, plan, housing)
    nose = _nose(rng, plan, gear)
    solenoid_radius = _solenoid_radius(rng, plan, housing)
    gearbox = _gearbox(rng, plan, housing, nose, solenoid_radius)
    solenoid = _solenoid(rng, plan, housing, gearbox, solenoid_radius)
    bracket = _bracket(rng, plan, housing, gearbox, nose, solenoid)
    if solenoid is not None:
        solenoid = _placed_solenoid(rng, plan, solenoid, gearbox, bracket)
    return MotorSpec(
        name=plan.name,
        family=plan.name,
        housing=housing,
        rear_cap=_rear_cap(rng, plan, housing),
        gearbox=gearbox,
        bracket=bracket,
        solenoid=solenoid,
        terminals=draw_terminals(rng, housing, solenoid),
        gear=_fitted_gear(gear, nose),
    )


def _housing(rng: np.random.Generator, plan: FamilyPlan) -> HousingSpec:
    radius = between(rng, *plan.yoke_radius_mm)
    length = round(radius * between(rng, *plan.yoke_aspect), 1)
    grooves: list[float] = []
    bands: list[float] = []
    if happens(rng, 0.45):
        grooves = [between(rng, 5, 12, 1), round(length - between(rng, 5, 12, 1), 1)]
        grooves = grooves[: whole(rng, 1, 2)]
    if happens(rng, 0.3):
        bands = [round(length * between(rng, 0.2, 0.8), 1)]
    flats = tuple(round(float(angle), 1) for angle in rng.uniform(0, 360, size=whole(rng, 1, 3)))
    has_plate = happens(rng, 0.45)
    return HousingSpec(
        radius_mm=radius,
        length_mm=length,
        ovality_mm=between(rng, 0, 0.5) if happens(rng, 0.4) else 0,
        crimps=one_of(rng, (0, 0, 0, 4, 6, 8)),
        grooves=tuple(grooves),
        bands=tuple(bands),
        flats=flats if happens(rng, 0.2) else (),
        flat_depth_mm=between(rng, 0.6, 2.2),
        seam_angle_deg=between(rng, 0, 360, 1) if happens(rng, 0.2) else None,
        name_plate_angle_deg=between(rng, 180, 360, 1) if has_plate else None,
        name_plate_size_mm=(between(rng, 25, 60, 1), between(rng, 14, 34, 1)),
        finish=one_of(rng, ("painted_steel", "painted_steel", "bare_steel", "zinc")),
    )


def _gear(rng: np.random.Generator, plan: FamilyPlan, housing: HousingSpec) -> GearSpec:
    teeth = whole(rng, *plan.teeth)
    module = between(rng, *plan.module_mm)
    _, tip = tooth_radii(GearSpec(teeth=teeth, module_mm=module))
    is_free = plan.nose == ("stub",)
    inertia = plan.name == "inertia"
    return GearSpec(
        teeth=teeth,
        module_mm=module,
        width_mm=round(tip * between(rng, 0.9, 1.5), 1),
        clutch_radius_mm=round(tip * between(rng, 1.0, 1.45), 1),
        clutch_length_mm=round(tip * between(rng, 0.6, 1.3) * (0.7 if is_free else 1.0), 1),
        shaft_radius_mm=round(tip * between(rng, 0.4, 0.52), 2),
        gap_mm=between(rng, *plan.free_gap_mm, 1),
        stop_ring=happens(rng, 0.75) or inertia,
        turn_deg=between(rng, 0, 360, 1),
    )


def _nose(rng: np.random.Generator, plan: FamilyPlan, gear: GearSpec) -> NoseSpec:
    """A nose around this gear, so that the gear always fits."""
    style = one_of(rng, plan.nose)
    _, tip = tooth_radii(gear)
    wall = between(rng, 3.2, 5.5) if tip < 18 else between(rng, 4.5, 7.5)
    widest = max(gear.clutch_radius_mm, tip)
    if style == "stub":
        radius = widest + wall + between(rng, 1.5, 5)
        return NoseSpec(
            style="stub",
            length_mm=round(radius * between(rng, *_COLLAR_ASPECT), 1),
            radius_mm=round(radius, 1),
            tip_radius_mm=round(0.9 * radius, 1),
            wall_mm=wall,
            window_width_deg=0,
        )
    radius = widest + wall + between(rng, 1.5, 6)
    front = (tip if style == "closed" else 0.8 * tip) + wall + between(rng, 0.8, 3.0)
    front = min(max(front, gear.shaft_radius_mm + wall + 3), radius)
    needed = gear.gap_mm + gear.clutch_length_mm + gear.width_mm + 1.1 * wall
    length = needed + between(rng, 3, 16, 1)
    # the clutch needs the full width up to where the pinion starts
    straight = min((gear.gap_mm + gear.clutch_length_mm) / length + 0.01, 0.8)
    is_open = style == "open"
    return NoseSpec(
        style="open" if is_open else "closed",
        length_mm=round(length, 1),
        radius_mm=round(radius, 1),
        tip_radius_mm=round(front, 1),
        straight=round(max(straight, between(rng, 0.05, 0.65)), 3),
        wall_mm=wall,
        window_angle_deg=between(rng, -125, -55, 1),
        window_width_deg=between(rng, 150, 235, 1) if is_open else between(rng, 70, 160, 1),
        window_length_mm=round(gear.width_mm + between(rng, 2, 14), 1),
        tip_boss_mm=between(rng, 0, 8, 1) if happens(rng, 0.85) else 0,
        bearing_open=happens(rng, 0.6),
    )


def _fitted_gear(gear: GearSpec, nose: NoseSpec) -> GearSpec:
    """Pull the clutch out of a collar that is too tight for its place."""
    if nose.style != "stub":
        return gear
    room = nose.radius_mm - nose.wall_mm - 0.5
    return gear.model_copy(update={"clutch_radius_mm": min(gear.clutch_radius_mm, round(room, 1))})


def _solenoid_radius(rng: np.random.Generator, plan: FamilyPlan, housing: HousingSpec) -> float:
    share = between(rng, 0.58, 0.78) if housing.radius_mm < 45 else between(rng, 0.48, 0.62)
    return round(housing.radius_mm * share, 1)


def _gearbox(
    rng: np.random.Generator,
    plan: FamilyPlan,
    housing: HousingSpec,
    nose: NoseSpec,
    solenoid_radius_mm: float,
) -> GearboxSpec | None:
    radius = housing.radius_mm
    if plan.gear_train == "direct":
        return None
    offset, angle = 0.0, 90.0
    if plan.gear_train == "offset":
        offset = round(radius * between(rng, 0.5, 0.9), 1)
        angle = between(rng, 60, 120, 1) if happens(rng, 0.5) else between(rng, -40, 40, 1)
    elif plan.gear_train == "coaxial":
        offset = round(radius + solenoid_radius_mm + between(rng, 2, 7), 1)
    return GearboxSpec(
        radius_mm=round(radius + between(rng, 0.5, 5), 1),
        length_mm=round(radius * between(rng, 0.5, 0.95), 1),
        shaft_offset_mm=offset,
        shaft_angle_deg=angle,
        ribs=one_of(rng, (0, 0, 6, 8, 12, 16)),
        flange_mm=between(rng, 1, 3.5, 1) if happens(rng, 0.4) else 0,
        finish=one_of(rng, ("cast_aluminium", "cast_aluminium", "zinc", "painted_steel")),
    )


def _solenoid(
    rng: np.random.Generator,
    plan: FamilyPlan,
    housing: HousingSpec,
    gearbox: GearboxSpec | None,
    radius_mm: float,
) -> SolenoidSpec | None:
    if plan.solenoid == "none":
        return None
    lowest, highest = {"short": (1.2, 1.8), "normal": (2.0, 2.9), "long": (3.0, 4.2)}[plan.solenoid]
    longest = max(0.95 * housing.length_mm, 1.2 * radius_mm)
    offset = round(housing.radius_mm + radius_mm + between(rng, 1.5, 7), 1)
    if gearbox is not None and plan.gear_train == "coaxial":
        offset = gearbox.shaft_offset_mm
    has_lever = happens(rng, plan.has_lever_housing)
    cap_share = between(rng, 0.82, 0.98)
    return SolenoidSpec(
        radius_mm=radius_mm,
        length_mm=round(min(radius_mm * between(rng, lowest, highest), longest), 1),
        offset_mm=offset,
        flange_radius_mm=round(radius_mm * between(rng, 1.1, 1.3), 1)
        if happens(rng, 0.45)
        else None,
        flange_mm=between(rng, 3, 6, 1),
        cap_length_mm=round(radius_mm * between(rng, 0.6, 1.2), 1),
        cap_radius_mm=round(radius_mm * cap_share, 1),
        cap_style=one_of(rng, ("round", "round", "stepped", "d_shaped", "square")),
        lever_housing=has_lever,
        lever_style=one_of(rng, ("slab", "hump", "hump", "ribbed", "plate", "plate")),
        plunger_boot=not has_lever and plan.gear_train != "coaxial" and happens(rng, 0.75),
        finish=one_of(rng, ("painted_steel", "zinc", "bare_steel")),
    )


def _bracket(
    rng: np.random.Generator,
    plan: FamilyPlan,
    housing: HousingSpec,
    gearbox: GearboxSpec | None,
    nose: NoseSpec,
    solenoid: SolenoidSpec | None,
) -> BracketSpec:
    behind = housing.radius_mm if gearbox is None else gearbox.radius_mm
    body = max(behind * between(rng, 0.8, 1.12), nose.radius_mm + 4)
    if gearbox is not None and gearbox.shaft_offset_mm > 0:
        body = max(behind * between(rng, 0.72, 0.9), nose.radius_mm + 4)
    flange_mm = between(rng, 7, 12, 1) * (1.0 if housing.radius_mm < 44 else 1.35)
    body_length = max(housing.radius_mm * between(rng, *plan.bracket_aspect), flange_mm + 2)
    style = one_of(rng, plan.flange)
    flange_radius = body * between(rng, 1.0, 1.14)
    centre = (0.0, 0.0)
    if gearbox is not None:
        centre = polar(gearbox.shaft_offset_mm, gearbox.shaft_angle_deg)
    return BracketSpec(
        radius_mm=round(body, 1),
        body_length_mm=round(body_length, 1),
        flange_mm=round(flange_mm, 1),
        flange_style=style,
        flange_radius_mm=round(flange_radius, 1),
        ears=_ears(rng, plan, flange_radius, centre, solenoid),
        ribs=one_of(rng, (0, 4, 6, 8, 10)),
        rib_mm=between(rng, 2.5, 5, 1),
        side_ribs=one_of(rng, (0, 0, 0, 6, 10, 14)),
        pockets=one_of(rng, (0, 0, 4, 6)),
        pilot_mm=between(rng, 1.5, 5, 1) if happens(rng, 0.4) else 0,
        finish="cast_iron" if happens(rng, plan.is_cast_iron) else "cast_aluminium",
        nose=nose,
    )


def _ears(
    rng: np.random.Generator,
    plan: FamilyPlan,
    flange_radius_mm: float,
    centre: tuple[float, float],
    solenoid: SolenoidSpec | None,
) -> tuple[EarSpec, ...]:
    """Ears around the pinion's axis, away from the solenoid, written down about the main axis."""
    count = one_of(rng, plan.ears)
    start = between(rng, -40, 25, 1)
    spread = {2: 180.0, 3: 110.0, 4: 88.0}[count] + between(rng, -16, 16, 1)
    if solenoid is not None and count == 4:
        start, spread = -25.0, -46.0  # all four below
    size = flange_radius_mm * between(rng, 0.25, 0.36)
    hole = one_of(rng, (8.5, 9, 10.5, 11, 12.5, 13))
    size = min(max(size, hole / 2 + 4), 27.0)
    ears: list[EarSpec] = []
    for index in range(count):
        angle = start - index * spread + between(rng, -8, 8, 1)
        if solenoid is not None and centre[1] < 20 and angle_apart_deg(angle, 90) < _FREE_DEG:
            angle = 90 + math.copysign(_FREE_DEG + 6, angle - 90)
        reach = between(rng, 0.3, 1.2) + (between(rng, 0.3, 1.4) if happens(rng, 0.2) else 0.0)
        x, y = polar(flange_radius_mm + size * reach, angle)
        x, y = x + centre[0], y + centre[1]
        ears.append(
            EarSpec(
                angle_deg=round(math.degrees(math.atan2(y, x)), 1),
                reach_mm=round(min(max(math.hypot(x, y), 20.5), 179.0), 1),
                radius_mm=round(max(size * between(rng, 0.88, 1.1), hole / 2 + 3), 1),
                hole_mm=hole,
                threaded=happens(rng, 0.25),
            )
        )
    return tuple(ears)


def _placed_solenoid(
    rng: np.random.Generator,
    plan: FamilyPlan,
    solenoid: SolenoidSpec,
    gearbox: GearboxSpec | None,
    bracket: BracketSpec,
) -> SolenoidSpec:
    """Put the pad somewhere between joint and flange."""
    joint = 0.0 if gearbox is None else gearbox.length_mm
    flange_front = joint + bracket.body_length_mm
    pad = min(between(rng, 6, 12, 1), bracket.body_length_mm - 1)
    if plan.gear_train == "coaxial":
        # the can ends at the gearbox's back
        update: dict[str, Any] = {"front_mm": 0.0, "pad_mm": pad}
        return solenoid.model_copy(update=update)
    latest = flange_front - pad - 0.5
    earliest = min(max(joint - 0.3 * solenoid.length_mm, -4.0), latest)
    front = between(rng, earliest, latest, 1)
    return solenoid.model_copy(update={"front_mm": front, "pad_mm": pad})


def _rear_cap(rng: np.random.Generator, plan: FamilyPlan, housing: HousingSpec) -> RearCapSpec:
    radius = housing.radius_mm
    style = one_of(rng, plan.caps)
    length = (
        radius
        * {
            "flat": between(rng, 0.22, 0.5),
            "domed": between(rng, 0.4, 0.75),
            "stepped": between(rng, 0.4, 0.7),
            "spider": between(rng, 0.2, 0.4),
        }[style]
    )
    own_radius = radius + between(rng, -1.2, 2.0, 1)
    return RearCapSpec(
        style=style,
        length_mm=round(length, 1),
        radius_mm=round(own_radius, 1) if happens(rng, 0.7) else None,
        hub_radius_mm=round(radius * between(rng, 0.2, 0.36), 1),
        hub_height_mm=between(rng, 1.5, 9, 1) if happens(rng, 0.8) else 0,
        hub_hollow=happens(rng, 0.3),
        edge_mm=between(rng, 0.6, 4.5, 1),
        ribs=one_of(rng, (0, 0, 0, 4, 6, 8)),
        openings=one_of(rng, (3, 4, 5, 6)),
        finish=one_of(
            rng, ("cast_aluminium", "cast_aluminium", "painted_steel", "zinc", "cast_iron")
        ),
    )
