"""Where heads sit, and the lugs that carry them there (frame `build`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from boltpose.factory.bolts import BoltSolid
from boltpose.factory.castings import bar, plate
from boltpose.factory.layout import Layout, cap_back_z
from boltpose.factory.solids import Manifold, cylinder, polar
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec, DistractorSpec, Site

_LUG_WALL_MM = 1.6
"""Material around a head's circle."""
_PAD_MM = 0.6
"""How far a machined pad stands over the curved back of a cap."""
_COVER_MM = 2.0
"""Material left below a shank's end."""
RIM_MM = 8.0
"""Thickness of the rim at the back of the bracket."""


class Body(StrEnum):
    """The bodies a motor is assembled from; each becomes one solid or more."""

    YOKE = "yoke"
    REAR_CAP = "rear_cap"
    GEARBOX = "gearbox"
    BRACKET = "bracket"
    SOLENOID_CAN = "solenoid_can"
    SOLENOID_CAP = "solenoid_cap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Seat:
    """Where a fastener sits: the centre of its seat and the way out of the material."""

    body: Body
    """What carries it."""
    centre_mm: tuple[float, float, float]
    outward: tuple[float, float, float]
    """Unit vector: along z, or radial on the yoke."""
    surface_z: float
    """Height of the surface around it; the seat is lower by the recess."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lug:
    """A pillar that a body grows, tied to `anchor_xy` by a web."""

    body: Body
    xy: tuple[float, float]
    radius_mm: float
    z_low: float
    z_high: float
    anchor_xy: tuple[float, float]
    reaches_out: bool
    """True: it stands out of its body and needs the web; False: a pillar is enough."""


def find_seat(
    spec: MotorSpec,
    layout: Layout,
    fastener: BoltSpec | DistractorSpec,
    *,
    head_radius_mm: float,
    recess_mm: float = 0,
) -> Seat:
    """Find the seat of a bolt or distractor.

    Args:
        spec: The motor.
        layout: Its stations.
        fastener: What is to sit there; its site, radius and angle count.
        head_radius_mm: Of the circle around the head, which must lie flat.
        recess_mm: How deep the seat is sunk.
    """
    site, radius, angle = fastener.site, fastener.radius_mm, fastener.angle_deg
    if site is Site.YOKE:
        unit = polar(1, angle)
        mantle = yoke_radius_mm(spec, angle)
        z = -fastener.z_mm if isinstance(fastener, DistractorSpec) else 0.0
        return Seat(
            body=Body.YOKE,
            centre_mm=(mantle * unit[0], mantle * unit[1], z),
            outward=(unit[0], unit[1], 0.0),
            surface_z=z,
        )
    body, surface, way = _surface(spec, layout, site, radius, head_radius_mm)
    origin = layout.solenoid_xy if site in _AT_SOLENOID else (0.0, 0.0)
    x, y = polar(radius, angle)
    return Seat(
        body=body,
        centre_mm=(origin[0] + x, origin[1] + y, surface - way * recess_mm),
        outward=(0.0, 0.0, float(way)),
        surface_z=surface,
    )


_AT_SOLENOID = (Site.SOLENOID_FRONT, Site.SOLENOID_REAR, Site.SOLENOID_CAP)


def yoke_radius_mm(spec: MotorSpec, angle_deg: float) -> float:
    """Distance of the oval mantle from the axis in one direction."""
    x, y = polar(1, angle_deg)
    large = spec.housing.radius_mm + 0.5 * spec.housing.ovality_mm
    small = spec.housing.radius_mm - 0.5 * spec.housing.ovality_mm
    return 1 / ((x / large) ** 2 + (y / small) ** 2) ** 0.5


def _surface(
    spec: MotorSpec, layout: Layout, site: Site, radius_mm: float, head_radius_mm: float
) -> tuple[Body, float, int]:
    """Body, height of the surface and way out (+1 or -1 along z)."""
    match site:
        case Site.REAR_CAP:
            inner = max(0.0, radius_mm - head_radius_mm - _LUG_WALL_MM)
            back = cap_back_z(spec, layout, inner)
            is_flat = abs(back - cap_back_z(spec, layout, radius_mm + head_radius_mm)) < 1e-6
            return Body.REAR_CAP, back if is_flat else back - _PAD_MM, -1
        case Site.GEARBOX_REAR if spec.gearbox is not None:
            return Body.GEARBOX, 0.0, -1
        case Site.GEARBOX_REAR:
            in_flange = radius_mm + head_radius_mm <= layout.flange_radius_mm
            beside_body = radius_mm - head_radius_mm >= spec.bracket.radius_mm
            at_flange = in_flange and beside_body
            return Body.BRACKET, layout.flange_rear_z if at_flange else 0.0, -1
        case Site.BRACKET_FRONT:
            return Body.BRACKET, layout.flange_front_z, 1
        case Site.RIM_FRONT:
            return Body.BRACKET, layout.bracket_rear_z + RIM_MM, 1
        case Site.NOSE_FRONT:
            return Body.BRACKET, layout.nose_front_z, 1
        case Site.SOLENOID_FRONT:
            return Body.BRACKET, layout.pad_front_z, 1
        case Site.SOLENOID_REAR:
            flange = 0.0 if spec.solenoid is None else spec.solenoid.flange_mm
            return Body.SOLENOID_CAN, layout.solenoid_front_z - flange, -1
        case Site.SOLENOID_CAP:
            return Body.SOLENOID_CAP, layout.solenoid_rear_z, -1
        case Site.YOKE:
            raise AssertionError("the yoke's seats are radial")


def find_lugs(
    spec: MotorSpec, layout: Layout, bolt: BoltSpec, solid: BoltSolid, seat: Seat
) -> list[Lug]:
    """Find what must grow so that the head sits, and the shank ends, in material.

    The first lug carries the head, the second, on the body behind the joint, takes the thread.
    """
    x, y, seat_z = seat.centre_mm
    way = seat.outward[2]
    wide = solid.head_diameter_mm / 2 + _LUG_WALL_MM + (0.6 if bolt.recess_mm else 0.0)
    narrow = solid.shank_radius_mm + 2.5
    end_z = seat_z - way * (solid.shank_mm + _COVER_MM)

    def lug(body: Body, radius_mm: float, first_z: float, second_z: float) -> Lug:
        return Lug(
            body=body,
            xy=(x, y),
            radius_mm=radius_mm,
            z_low=min(first_z, second_z),
            z_high=max(first_z, second_z),
            anchor_xy=_anchor(layout, bolt, _core_radius_mm(spec, layout, body, bolt.site)),
            reaches_out=bolt.radius_mm + radius_mm
            > _core_radius_mm(spec, layout, body, bolt.site) - 0.5,
        )

    front = Body.GEARBOX if spec.gearbox is not None else Body.BRACKET
    found: list[Lug] = []
    match bolt.site:
        case Site.REAR_CAP:
            found.append(lug(Body.REAR_CAP, wide, seat.surface_z, layout.yoke_rear_z))
            if end_z > 1:
                room = layout.bracket_rear_z if front is Body.GEARBOX else layout.flange_front_z
                found.append(lug(front, narrow, 0, min(end_z, room)))
        case Site.GEARBOX_REAR if front is Body.GEARBOX:
            found.append(lug(Body.GEARBOX, wide, 0, layout.bracket_rear_z))
            if end_z > layout.bracket_rear_z:
                reach = min(end_z, layout.flange_front_z)
                found.append(lug(Body.BRACKET, narrow, layout.bracket_rear_z, reach))
        case Site.GEARBOX_REAR:
            reach = min(max(end_z, seat.surface_z + 4), layout.flange_front_z)
            found.append(lug(Body.BRACKET, wide, seat.surface_z, reach))
        case Site.BRACKET_FRONT:
            found.append(lug(Body.BRACKET, wide, layout.bracket_rear_z, layout.flange_front_z))
            if end_z < layout.bracket_rear_z and front is Body.GEARBOX:
                found.append(lug(front, narrow, max(end_z, 0), layout.bracket_rear_z))
        case Site.RIM_FRONT:
            found.append(lug(Body.BRACKET, wide, layout.bracket_rear_z, seat.surface_z))
            if end_z < layout.bracket_rear_z and front is Body.GEARBOX:
                found.append(lug(front, wide, max(end_z, 0), layout.bracket_rear_z))
            elif end_z < 0:
                found.append(lug(Body.YOKE, wide, end_z, 0))
        case Site.NOSE_FRONT:
            found.append(lug(Body.BRACKET, narrow, seat_z, end_z))
        case Site.SOLENOID_FRONT:
            found.append(lug(Body.BRACKET, wide, layout.solenoid_front_z, layout.pad_front_z))
            if end_z < layout.solenoid_front_z:
                found.append(lug(Body.SOLENOID_CAN, wide, end_z, layout.solenoid_front_z))
        case Site.SOLENOID_REAR:
            found.append(lug(Body.SOLENOID_CAN, wide, seat.surface_z, layout.solenoid_front_z))
            reach = min(max(end_z, layout.solenoid_front_z + 3), layout.pad_front_z)
            if math.dist(layout.shaft_xy, layout.solenoid_xy) < 1:
                # a solenoid in line with the pinion stands on the gearbox
                reach = min(reach, layout.bracket_rear_z)
                found.append(lug(Body.GEARBOX, wide, layout.solenoid_front_z, reach))
            else:
                found.append(lug(Body.BRACKET, wide, layout.solenoid_front_z, reach))
        case Site.SOLENOID_CAP:
            found.append(lug(Body.SOLENOID_CAP, wide, seat.surface_z, layout.can_rear_z))
            if end_z > layout.can_rear_z:
                found.append(lug(Body.SOLENOID_CAN, narrow, layout.can_rear_z, end_z))
        case Site.YOKE:
            raise AssertionError("bolts are parallel to z")
    return found


def _core_radius_mm(spec: MotorSpec, layout: Layout, body: Body, site: Site) -> float:
    """Radius, about the axis that the site counts from, inside which a body is surely solid."""
    if site in _AT_SOLENOID:
        assert spec.solenoid is not None
        return (
            layout.solenoid_cap_radius_mm
            if body is Body.SOLENOID_CAP
            else 0.9 * (spec.solenoid.radius_mm)
        )
    match body:
        case Body.REAR_CAP:
            return layout.cap_radius_mm
        case Body.GEARBOX:
            return spec.housing.radius_mm if spec.gearbox is None else spec.gearbox.radius_mm
        case Body.BRACKET:
            if site is Site.NOSE_FRONT:
                return spec.bracket.nose.tip_radius_mm
            return 0.85 * spec.bracket.radius_mm
        case _:
            return spec.housing.radius_mm


def _anchor(layout: Layout, bolt: BoltSpec, core_mm: float) -> tuple[float, float]:
    origin = layout.solenoid_xy if bolt.site in _AT_SOLENOID else (0.0, 0.0)
    x, y = polar(min(bolt.radius_mm, 0.7 * core_mm), bolt.angle_deg)
    return origin[0] + x, origin[1] + y


def lug_bodies(lugs: Sequence[Lug], body: Body, *, round_mm: float = 0.8) -> list[Manifold]:
    """Shape the lugs of one body."""
    shapes: list[Manifold] = []
    for lug in lugs:
        if lug.body is not body or lug.z_high - lug.z_low < 0.2:
            continue
        if lug.reaches_out:
            outline = bar(lug.xy, lug.radius_mm, lug.anchor_xy, 1.35 * lug.radius_mm)
            shapes.append(
                plate(
                    outline,
                    lug.z_low,
                    lug.z_high,
                    round_low_mm=min(round_mm, 0.2 * lug.radius_mm),
                    round_high_mm=min(round_mm, 0.2 * lug.radius_mm),
                )
            )
        else:
            pillar = cylinder(lug.radius_mm, lug.z_low, lug.z_high)
            shapes.append(pillar.translate((*lug.xy, 0)))
    return shapes
