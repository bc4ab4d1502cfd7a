"""The solenoid: steel can with flange and crimps, plastic cap, plunger boot. Frame `build`."""

from __future__ import annotations

from collections.abc import Sequence

from boltpose.factory.castings import disc, joined, plate, turned_eased
from boltpose.factory.layout import D_CAP_WALL, Layout
from boltpose.factory.model import Material
from boltpose.factory.pieces import Piece
from boltpose.factory.sites import Body, Lug, lug_bodies
from boltpose.factory.solids import CrossSection, Manifold, box, union
from boltpose.factory.spec import MotorSpec, SolenoidSpec
from boltpose.schema import Part


def build_solenoid(spec: MotorSpec, layout: Layout, lugs: Sequence[Lug]) -> list[Piece]:
    """Shape the solenoid; nothing for a motor without one."""
    solenoid = spec.solenoid
    if solenoid is None:
        return []
    place = (*layout.solenoid_xy, 0.0)
    can = union([_can(solenoid, layout).translate(place), *lug_bodies(lugs, Body.SOLENOID_CAN)])
    cap = union([_cap(solenoid, layout).translate(place), *lug_bodies(lugs, Body.SOLENOID_CAP)])
    can = can.trim_by_plane((0, 0, -1), -layout.solenoid_front_z)
    can = can.trim_by_plane((0, 0, 1), layout.can_rear_z)
    pieces = [
        Piece(
            name="solenoid_can",
            part=Part.SOLENOID,
            material=Material(solenoid.finish),
            shape=can,
            body=Body.SOLENOID_CAN,
        ),
        Piece(
            name="solenoid_cap",
            part=Part.SOLENOID,
            material=Material.BLACK_PLASTIC,
            shape=cap.trim_by_plane((0, 0, -1), -layout.can_rear_z),
            body=Body.SOLENOID_CAP,
        ),
    ]
    if solenoid.plunger_boot:
        pieces.append(
            Piece(
                name="solenoid_boot",
                part=Part.SOLENOID,
                material=Material.RUBBER,
                shape=_boot(solenoid, layout).translate(place),
            )
        )
    return pieces


def _can(solenoid: SolenoidSpec, layout: Layout) -> Manifold:
    """Front rim, groove, mantle and the rolled edge over the cap; a flange where asked for."""
    low, high, radius = layout.can_rear_z, layout.solenoid_front_z, solenoid.radius_mm
    rim = min(5.0, 0.12 * solenoid.length_mm)
    body = turned_eased(
        [
            (0, low, 0),
            (radius - 2.0, low, 0.6),
            (radius - 0.2, low + 2.0, 1),
            (radius - 0.2, low + rim, 0.5),
            (radius - 1.1, low + rim + 1, 0.4),
            (radius - 0.9, low + rim + 2.2, 0.4),
            (radius - 0.9, high - rim - 2.0, 0.4),
            (radius, high - rim - 1.2, 0.4),
            (radius, high, 0.8),
            (0, high, 0),
        ]
    )
    if solenoid.flange_radius_mm is not None:
        wide = solenoid.flange_radius_mm
        # flattened above and below, as stamped flanges are
        lozenge = disc(wide) ^ CrossSection.square((2.4 * wide, 2.04 * radius), True)
        outline = joined([lozenge, disc(1.02 * radius)], fillet_mm=2, round_mm=2)
        body += plate(outline, high - solenoid.flange_mm, high, round_low_mm=0.6, round_high_mm=0.3)
    return body


def _cap(solenoid: SolenoidSpec, layout: Layout) -> Manifold:
    low, high = layout.solenoid_rear_z, layout.can_rear_z
    radius, length = layout.solenoid_cap_radius_mm, solenoid.cap_length_mm
    match solenoid.cap_style:
        case "round":
            return turned_eased(
                [(0, low, 0), (0.94 * radius, low, 2), (radius, high, 0), (0, high, 0)]
            )
        case "stepped":
            step = high - 0.4 * length
            return turned_eased(
                [
                    (0, low, 0),
                    (0.78 * radius, low, 1.5),
                    (0.82 * radius, step, 1),
                    (radius, step, 1),
                    (radius, high, 0),
                    (0, high, 0),
                ]
            )
        case "square":
            side = CrossSection.square((1.5 * radius, 1.5 * radius), True)
            outline = joined([side], round_mm=3)
            step = high - 0.35 * length
            head = plate(outline, low, step + 1, round_low_mm=1.2)
            foot = turned_eased([(0, step, 0), (radius, step, 1), (radius, high, 0), (0, high, 0)])
            return head + foot
        case "d_shaped":
            cut = CrossSection.square((2.2 * radius, 2.2 * radius), True)
            outline = joined([disc(radius) ^ cut.translate((0, 0.45 * radius))], round_mm=2.5)
            base = plate(outline, low, high, round_low_mm=1.5, draft_deg=0)
            wall = box((0.9 * radius, 2.5, 0.25 * length), (0, 0.1 * radius, low - 0.1 * length))
            return base + wall.trim_by_plane((0, 0, 1), low - D_CAP_WALL * length)


def _boot(solenoid: SolenoidSpec, layout: Layout) -> Manifold:
    """Rubber bellows over the plunger, with the rod's eye in front."""
    front, radius = layout.pad_front_z, 0.52 * solenoid.radius_mm
    profile = [(0.0, front, 0.0), (1.1 * radius, front, 0.5), (1.1 * radius, front + 2, 0.5)]
    z = front + 2.5
    for fold in range(4):
        wide = radius * (1 - 0.06 * fold)
        profile += [(0.72 * wide, z, 0.5), (wide, z + 1.8, 0.5)]
        z += 3.6
    profile += [(0.6 * radius, z, 0.5), (0.45 * radius, z + 3, 0.8), (0.0, z + 3, 0.0)]
    return turned_eased(profile)
