"""Ribs, gussets and pockets of the bracket's casting. Frame `build`."""

from __future__ import annotations

import math

from boltpose.factory.castings import CrossSection, joined, plate, wedge
from boltpose.factory.layout import Layout
from boltpose.factory.solids import Manifold, polar, prism
from boltpose.factory.spec import MotorSpec

_POCKET_WALL_MM = 3.5


def gusset(
    angle_deg: float,
    centre_mm: tuple[float, float],
    outline_mm: list[tuple[float, float]],
    thickness_mm: float,
) -> Manifold:
    """A rib: a polygon of (radius, z), set upright in direction `angle_deg` of a centre."""
    area = sum(
        x0 * y1 - x1 * y0
        for (x0, y0), (x1, y1) in zip(outline_mm, [*outline_mm[1:], outline_mm[0]], strict=True)
    )
    polygon = outline_mm if area > 0 else outline_mm[::-1]
    upright = prism(polygon, -thickness_mm / 2, thickness_mm / 2).rotate((90, 0, 0))
    return upright.rotate((0, 0, angle_deg)).translate((*centre_mm, 0))


def is_near(first_deg: float, second_deg: float, width_deg: float) -> bool:
    """Whether two directions differ by less than half a width."""
    return abs((first_deg - second_deg + 180) % 360 - 180) < width_deg / 2


def build_ribs(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    """Ribs in front of the flange at the nose's foot; behind it where there is but a collar."""
    bracket = spec.bracket
    nose = bracket.nose
    if bracket.ribs == 0:
        return []
    angles = [90 + 360 * (index + 0.5) / bracket.ribs for index in range(bracket.ribs)]
    if nose.style == "stub":
        low, high = layout.bracket_rear_z + 1, layout.flange_rear_z + 1
        inner, outer = 0.8 * bracket.radius_mm, 0.97 * layout.flange_radius_mm
        if high - low < 3 or outer - bracket.radius_mm < 2:
            return []
        foot = bracket.radius_mm + 0.5
        shape = [(inner, low), (foot, low), (outer, high - 1), (outer, high), (inner, high)]
    else:
        low = layout.flange_front_z - 1
        high = low + 1 + 0.36 * nose.length_mm
        outer = min(nose.radius_mm + 0.3 * nose.length_mm, 0.95 * layout.flange_radius_mm)
        inner = 0.93 * nose.radius_mm
        if outer - nose.radius_mm < 2.5:
            return []
        shape = [(inner, low), (outer, low), (outer, low + 2), (inner + 2, high), (inner, high)]
        angles = [
            angle
            for angle in angles
            if nose.window_width_deg <= 0
            or not is_near(angle, nose.window_angle_deg, nose.window_width_deg + 16)
        ]
    return [gusset(angle, layout.shaft_xy, shape, bracket.rib_mm) for angle in angles]


def side_ribs(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    """Ribs along the body's side, from the joint to the flange."""
    bracket = spec.bracket
    low, high = layout.bracket_rear_z + 0.5, layout.flange_rear_z + 1
    if bracket.side_ribs == 0 or high - low < 3:
        return []
    inner, outer = 0.8 * bracket.radius_mm, max(bracket.radius_mm + 2.6, 0.0)
    shape = [(inner, low), (outer - 1, low), (outer, low + 1), (outer, high), (inner, high)]
    return [
        gusset(360 * (index + 0.25) / bracket.side_ribs, layout.shaft_xy, shape, bracket.rib_mm)
        for index in range(bracket.side_ribs)
    ]


def ear_gussets(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    """A rib behind each ear, from the body out to its boss."""
    bracket, (cx, cy) = spec.bracket, layout.shaft_xy
    depth = min(layout.flange_rear_z - layout.bracket_rear_z - 1, 16.0)
    if depth < 3:
        return []
    base = layout.flange_rear_z + 1
    ribs: list[Manifold] = []
    for ear in bracket.ears:
        x, y = polar(ear.reach_mm, ear.angle_deg)
        angle = math.degrees(math.atan2(y - cy, x - cx))
        reach = math.hypot(x - cx, y - cy) - 0.85 * ear.radius_mm
        inner = 0.7 * bracket.radius_mm
        if reach < bracket.radius_mm + 3:
            continue
        shape = [(inner, base), (reach, base), (reach, base - 2.5), (inner, base - depth)]
        offset = 0.5 * ear.radius_mm
        for side in (-1, 1):
            dx, dy = polar(side * offset, angle + 90)
            ribs.append(gusset(angle, (cx + dx, cy + dy), shape, bracket.rib_mm))
    return ribs


def pockets(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    """Hollows in the front face between nose and rim."""
    bracket = spec.bracket
    inner = bracket.nose.radius_mm + 4 + _POCKET_WALL_MM
    outer = layout.flange_radius_mm - _POCKET_WALL_MM
    if bracket.pockets == 0 or outer - inner < 4:
        return []
    depth = min(0.6 * bracket.flange_mm + bracket.pilot_mm, 0.5 * bracket.body_length_mm)
    ring = CrossSection.circle(outer, 96) - CrossSection.circle(inner, 96)
    gap = 360 * (bracket.rib_mm + 4) / (2 * math.pi * inner)
    width = 360 / bracket.pockets - gap
    if width < 8:
        return []
    low, high = layout.flange_front_z - depth, layout.flange_front_z + bracket.pilot_mm + 0.5
    shapes: list[Manifold] = []
    for index in range(bracket.pockets):
        # between the ribs, which stand half a step off
        angle = 90 + 360 * index / bracket.pockets
        sector = joined([ring ^ wedge(2 * outer, angle, width)], round_mm=1.8)
        if sector.is_empty():
            continue
        shapes.append(plate(sector, low, high, round_low_mm=0.8).translate((*layout.shaft_xy, 0)))
    return shapes
