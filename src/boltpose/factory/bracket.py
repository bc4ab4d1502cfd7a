"""The drive-end bracket: body, flange with ears, nose, pad and lever housing. Frame `build`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from boltpose.factory.castings import bar, disc, joined, plate, turned_eased
from boltpose.factory.gearbox import gearbox_outline
from boltpose.factory.layout import Layout
from boltpose.factory.model import Material
from boltpose.factory.nose import shape_nose
from boltpose.factory.pieces import Piece
from boltpose.factory.ribs import build_ribs, ear_gussets, pockets, side_ribs
from boltpose.factory.sites import RIM_MM, Body, Lug, lug_bodies
from boltpose.factory.solids import CrossSection, Manifold, cylinder, hull, polar, union
from boltpose.factory.spec import MotorSpec
from boltpose.schema import Part

_EDGE_MM = 1.2
_DRAFT_DEG = 1.5
_CAN_PLAY_MM = 0.8


def build_bracket(spec: MotorSpec, layout: Layout, lugs: Sequence[Lug]) -> list[Piece]:
    """Shape the bracket."""
    nose = shape_nose(spec, layout)
    grown = [
        _core(spec, layout),
        _flange(spec, layout),
        nose.outer,
        *build_ribs(spec, layout),
        *ear_gussets(spec, layout),
        *side_ribs(spec, layout),
        *_lever_housing(spec, layout),
    ]
    # lugs come after the pockets, so that every head has its seat
    body = union(grown) - union(pockets(spec, layout)) + union(lug_bodies(lugs, Body.BRACKET))
    body -= union([nose.cut, *_ear_holes(spec, layout)])
    return [
        Piece(
            name="connector_bracket",
            part=Part.CONNECTOR,
            material=Material(spec.bracket.finish),
            shape=body - _room_for_neighbours(spec, layout),
            body=Body.BRACKET,
        )
    ]


def _core(spec: MotorSpec, layout: Layout) -> Manifold:
    """What leads from the joint to the flange."""
    low, high, radius = layout.bracket_rear_z, layout.flange_front_z, spec.bracket.radius_mm
    if layout.shaft_xy != (0.0, 0.0):
        outline = gearbox_outline(spec, layout)
        middle = low + 0.6 * (high - low)
        rear = plate(outline, low, middle, round_low_mm=0.6, round_high_mm=4, draft_deg=_DRAFT_DEG)
        return rear + cylinder(radius, low, high - 0.5).translate((*layout.shaft_xy, 0))
    behind = spec.housing.radius_mm if spec.gearbox is None else spec.gearbox.radius_mm
    rim = max(behind + 0.6, radius)
    step = min(low + RIM_MM, high - 2)
    if rim - radius < 1.5:
        profile = [(0, low, 0), (rim, low, 0.8), (radius, high - 0.5, 0), (0, high - 0.5, 0)]
    else:
        taper = min(step + 0.8 * (rim - radius), high - 1)
        profile = [
            (0, low, 0),
            (rim, low, 0.8),
            (rim, step, 2.5),
            (radius, taper, 3),
            (radius, high - 0.5, 0),
            (0, high - 0.5, 0),
        ]
    return turned_eased(profile)


def flange_outline(spec: MotorSpec, layout: Layout) -> CrossSection:
    """Outline of the mounting flange with its ears."""
    bracket, centre = spec.bracket, layout.shaft_xy
    radius = layout.flange_radius_mm
    ears = [(polar(ear.reach_mm, ear.angle_deg), ear.radius_mm) for ear in bracket.ears]
    discs = [disc(radius, centre), *(disc(size, place) for place, size in ears)]
    match bracket.flange_style:
        case "polygon":
            return CrossSection.batch_hull(discs)
        case "round":
            arms = [bar(place, size, centre, size) for place, size in ears]
            return joined([*discs, *arms], fillet_mm=4)
        case "ears":
            arms = [bar(place, size, centre, max(0.8 * radius, size)) for place, size in ears]
            return joined([*discs, *arms], fillet_mm=7)


def _flange(spec: MotorSpec, layout: Layout) -> Manifold:
    bracket, front = spec.bracket, layout.flange_front_z
    shapes = [
        plate(
            flange_outline(spec, layout),
            layout.flange_rear_z,
            front,
            round_low_mm=_EDGE_MM + 0.6,
            round_high_mm=_EDGE_MM,
        )
    ]
    for ear in bracket.ears:
        x, y = polar(ear.reach_mm, ear.angle_deg)
        back = layout.flange_rear_z - (9.0 if ear.threaded else 1.0)
        shapes.append(
            turned_eased(
                [
                    (0, back, 0),
                    (0.82 * ear.radius_mm, back, 0.8),
                    (0.88 * ear.radius_mm, front + 0.5, 0.4),
                    (0, front + 0.5, 0),
                ]
            ).translate((x, y, 0))
        )
    if bracket.pilot_mm > 0:
        radius = 0.93 * min(layout.flange_radius_mm, bracket.radius_mm + 2)
        pilot = turned_eased(
            [
                (0, front - 1, 0),
                (radius, front - 1, 0),
                (radius, front + bracket.pilot_mm, 0.8),
                (0, front + bracket.pilot_mm, 0),
            ]
        )
        shapes.append(pilot.translate((*layout.shaft_xy, 0)))
    return union(shapes)


def _ear_holes(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    low, high = layout.flange_rear_z - 12, layout.flange_front_z + 1
    holes: list[Manifold] = []
    for ear in spec.bracket.ears:
        if ear.hole_mm <= 0:
            continue
        radius = ear.hole_mm / 2
        mouth = cylinder(radius, high - 1.3, high, top_radius_mm=radius + 1.3)
        holes.append(
            (cylinder(radius, low, high) + mouth).translate(
                (*polar(ear.reach_mm, ear.angle_deg), 0)
            )
        )
    return holes


def _lever_housing(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    """The pad in front of the solenoid, and the hump over the shift lever."""
    solenoid = spec.solenoid
    if solenoid is None:
        return []
    back, front = layout.solenoid_front_z, layout.pad_front_z
    x, y = layout.solenoid_xy
    radius = solenoid.radius_mm
    foot = 0.72 * spec.bracket.radius_mm
    low = min(max(back, layout.bracket_rear_z), layout.flange_front_z - 2)
    shapes = [
        plate(disc(radius, (x, y)), back, front, round_low_mm=0.6, round_high_mm=1.5, draft_deg=2)
    ]
    beside = math.hypot(x - layout.shaft_xy[0], y - layout.shaft_xy[1]) > radius
    if beside:
        # a pad behind the joint reaches forward over the gearbox to the bracket
        neck = bar((x, y), 0.78 * radius, layout.shaft_xy, foot)
        high = max(front, min(layout.bracket_rear_z + 5, layout.flange_front_z))
        shapes.append(plate(neck, back, high, round_low_mm=2, round_high_mm=2))
    if not solenoid.lever_housing:
        if not solenoid.plunger_boot and beside:
            shapes.append(
                turned_eased(
                    [
                        (0, front - 1, 0),
                        (0.6 * radius, front - 1, 0),
                        (0.5 * radius, front + 5, 2),
                        (0, front + 5, 0),
                    ]
                ).translate((x, y, 0))
            )
        return shapes
    crest = max(layout.flange_front_z - 0.6, front + 3)
    near = (0.5 * layout.shaft_xy[0], 0.5 * (0.9 * spec.bracket.radius_mm + layout.shaft_xy[1]))
    match solenoid.lever_style:
        case "slab":
            rise = front + 0.35 * (crest - front) + 3
            shapes.append(
                hull(
                    [
                        _dome_disc(0.74 * radius, (x, y), front - 2, rise),
                        _dome_disc(0.66 * radius, near, low, crest),
                    ]
                )
            )
        case "hump":
            rise = front + min(0.55 * radius, max(crest - front, 4.0))
            shapes.append(
                hull(
                    [
                        _dome_disc(0.97 * radius, (x, y), front - 3, front + 0.3 * (rise - front)),
                        _dome_disc(0.5 * radius, (x, y - 0.2 * radius), front - 1, rise),
                        _dome_disc(0.62 * spec.bracket.radius_mm, near, low, crest),
                    ]
                )
            )
        case "plate":
            outline = bar((x, y), 1.03 * radius, (0, 0), 0.98 * spec.housing.radius_mm)
            shapes.append(plate(outline, back, front, round_low_mm=0.8, round_high_mm=1.2))
            start = (x, y - 0.1 * radius)
            shapes.append(
                hull(
                    [
                        _dome_disc(
                            0.36 * radius, start, front - 1, front + 0.2 * (crest - front) + 2
                        ),
                        _dome_disc(0.55 * radius, near, low, crest),
                    ]
                )
            )
        case "ribbed":
            middle = 0.5 * (front + min(crest, front + 6))
            outline = joined(
                [
                    disc(0.9 * radius, (x, y)),
                    bar((x, y), 0.42 * radius, layout.shaft_xy, 0.5 * spec.bracket.radius_mm),
                    disc(0.8 * spec.bracket.radius_mm, layout.shaft_xy),
                ],
                fillet_mm=9,
            )
            shapes.append(plate(outline, low, middle, round_high_mm=1.5))
            for shift in (-0.45, 0.0, 0.45):
                dx = shift * radius
                start, end = (x + dx, y + 0.3 * radius), (layout.shaft_xy[0] + dx, near[1])
                rib = bar(start, 2.2, end, 2.8)
                shapes.append(plate(rib, low, max(crest, middle + 2), round_high_mm=1.2))
    return shapes


def _dome_disc(radius_mm: float, xy: tuple[float, float], low_z: float, high_z: float) -> Manifold:
    """A disc with a well rounded front edge, to hull with others."""
    edge = min(0.35 * radius_mm, 0.45 * (high_z - low_z))
    profile = [(0, low_z, 0), (radius_mm, low_z, 0), (radius_mm, high_z, edge), (0, high_z, 0)]
    return turned_eased(profile).translate((*xy, 0))


def _room_for_neighbours(spec: MotorSpec, layout: Layout) -> Manifold:
    """What the bracket leaves free: yoke or gearbox behind it, and the solenoid with some air."""
    reach = 400.0
    room = cylinder(spec.housing.radius_mm + 0.5, -reach, 0)
    if spec.gearbox is not None:
        room += gearbox_outline(spec, layout).offset(0.5).extrude(layout.bracket_rear_z)
    solenoid = spec.solenoid
    if solenoid is not None:
        can = cylinder(
            solenoid.radius_mm + _CAN_PLAY_MM, layout.solenoid_rear_z, layout.solenoid_front_z
        )
        room += can.translate((*layout.solenoid_xy, 0))
    return room
