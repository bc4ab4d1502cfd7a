"""The nose around the pinion: a bell with a window, an arm, or a collar. Frame `build`."""

from __future__ import annotations

from dataclasses import dataclass

from boltpose.factory.castings import plate, turned_eased, wedge
from boltpose.factory.layout import Layout
from boltpose.factory.solids import Manifold, cylinder
from boltpose.factory.spec import MotorSpec

_TAPER = 0.77
"""How much of what remains behind the straight part is tapered."""
_FOOT_MM = 4.0
_CLUTCH_PLAY_MM = 1.5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NoseShape:
    """A nose in two steps, so that lugs and ribs can be joined to it before it is hollowed."""

    outer: Manifold
    cut: Manifold
    """Cavity, window and bearing bore; reaches into the bracket."""


def cavity_floor_z(spec: MotorSpec, layout: Layout) -> float:
    """How deep the clutch's room reaches into the bracket; the shaft comes out of its floor."""
    depth = min(0.55 * spec.bracket.body_length_mm, 14.0)
    return layout.flange_front_z - depth


def boss_radius_mm(spec: MotorSpec) -> float:
    """Of the front bearing's boss."""
    return min(0.72 * spec.bracket.nose.tip_radius_mm, spec.gear.shaft_radius_mm + 6.5)


def room_radius_mm(spec: MotorSpec, layout: Layout, z: float) -> float:
    """Free radius inside the nose at a height."""
    nose = spec.bracket.nose
    foot, tip = nose.radius_mm - nose.wall_mm, nose.tip_radius_mm - nose.wall_mm
    if nose.style == "stub":
        return foot
    straight, shoulder = _taper_z(spec, layout)
    taper = min(max((z - straight) / (shoulder - straight), 0.0), 1.0)
    return foot + taper * (tip - foot)


def _taper_z(spec: MotorSpec, layout: Layout) -> tuple[float, float]:
    """Where the taper begins and ends."""
    nose = spec.bracket.nose
    foot, ceiling = layout.flange_front_z, layout.nose_front_z - 1.1 * nose.wall_mm
    end = nose.straight + _TAPER * (1 - nose.straight)
    shoulder = min(foot + end * nose.length_mm, ceiling - 1.5)
    straight = min(foot + max(nose.straight * nose.length_mm, 0.5), shoulder - 1.0)
    return straight, shoulder


def shape_nose(spec: MotorSpec, layout: Layout) -> NoseShape:
    """Shape the nose of a motor about the pinion's axis."""
    collar = spec.bracket.nose.style == "stub"
    shape = _collar(spec, layout) if collar else _bell(spec, layout)
    x, y = layout.shaft_xy
    return NoseShape(outer=shape.outer.translate((x, y, 0)), cut=shape.cut.translate((x, y, 0)))


def _collar(spec: MotorSpec, layout: Layout) -> NoseShape:
    nose = spec.bracket.nose
    foot, front = layout.flange_front_z, layout.nose_front_z
    flare = min(_FOOT_MM, 0.4 * nose.length_mm)
    outer = turned_eased(
        [
            (0, foot - 2, 0),
            (nose.radius_mm + flare, foot - 2, 0),
            (nose.radius_mm + flare, foot, 0),
            (nose.radius_mm, foot, flare),
            (nose.radius_mm, front, 1.5),
            (0, front, 0),
        ]
    )
    room = room_radius_mm(spec, layout, front)
    return NoseShape(outer=outer, cut=cylinder(room, cavity_floor_z(spec, layout), front + 1))


def _bell(spec: MotorSpec, layout: Layout) -> NoseShape:
    nose = spec.bracket.nose
    foot, front = layout.flange_front_z, layout.nose_front_z
    straight, shoulder = _taper_z(spec, layout)
    radius, tip, wall = nose.radius_mm, nose.tip_radius_mm, nose.wall_mm
    profile = [
        (0, foot - 2, 0),
        (radius + _FOOT_MM, foot - 2, 0),
        (radius + _FOOT_MM, foot, 0),
        (radius, foot, _FOOT_MM),
        (radius, straight, 5),
        (tip, shoulder, 4),
        (tip, front, 2.5),
    ]
    boss = boss_radius_mm(spec)
    if nose.tip_boss_mm > 0:
        profile += [(boss, front, 1), (boss, layout.nose_tip_z, 1)]
    outer = turned_eased([*profile, (0, layout.nose_tip_z, 0)])
    floor, ceiling = cavity_floor_z(spec, layout), front - 1.1 * wall
    room = turned_eased(
        [
            (0, floor, 0),
            (radius - wall, floor, 1),
            (radius - wall, straight, 5),
            (tip - wall, shoulder, 4),
            (tip - wall, ceiling, 2),
            (0, ceiling, 0),
        ]
    )
    cuts = room + _window(spec, layout, ceiling)
    if nose.bearing_open:
        bore = spec.gear.shaft_radius_mm + 0.4
        cuts += cylinder(bore, ceiling - 1, layout.nose_tip_z + 1)
        cuts += cylinder(
            bore, layout.nose_tip_z - 0.8, layout.nose_tip_z + 0.01, top_radius_mm=bore + 1
        )
    return NoseShape(outer=outer, cut=cuts)


def _window(spec: MotorSpec, layout: Layout, ceiling_z: float) -> Manifold:
    """The opening for the ring gear, corners rounded."""
    nose = spec.bracket.nose
    if nose.style == "open":
        low, high = layout.flange_front_z + 0.5, ceiling_z
    else:
        high = ceiling_z - 0.5
        low = max(high - nose.window_length_mm, layout.flange_front_z + 1)
    if nose.window_width_deg <= 0 or high - low < 4:
        return Manifold()
    sector = wedge(2.5 * nose.radius_mm, nose.window_angle_deg, nose.window_width_deg)
    return plate(sector, low, high, round_low_mm=2.5, round_high_mm=2.5)
