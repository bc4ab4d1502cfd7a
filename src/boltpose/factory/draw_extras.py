"""Draws what looks like a bolt and is none, where bolts and terminals leave room."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from boltpose.factory.bolts import build_bolt
from boltpose.factory.draws import Room, between, happens, one_of, whole
from boltpose.factory.layout import Layout, lay_out
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import DistractorKind, DistractorSpec, Site

_LUG_MM = 2.6
"""Around a head, for the lug that carries it."""
_MAX_PER_SITE = 4


@dataclass
class _Draw:
    """One motor's draw in progress."""

    rng: np.random.Generator
    spec: MotorSpec
    layout: Layout
    items: list[DistractorSpec] = field(default_factory=list)
    top: Room = field(default_factory=Room)
    bottom: Room = field(default_factory=Room)

    def add(
        self,
        kind: DistractorKind,
        site: Site,
        xy: tuple[float, float],
        size_mm: float,
        height_mm: float,
    ) -> None:
        """Add one whose place, about the site's own axis, is still free."""
        at_solenoid = site.value.startswith("solenoid")
        origin = self.layout.solenoid_xy if at_solenoid else (0.0, 0.0)
        radius, angle = math.hypot(*xy), math.degrees(math.atan2(xy[1], xy[0]))
        room = self.top if site.value.endswith("front") else self.bottom
        if room.take(radius, angle, 0.62 * size_mm + 1, origin):
            self.items.append(
                DistractorSpec(
                    kind=kind,
                    site=site,
                    radius_mm=round(radius, 2),
                    angle_deg=round(angle, 2),
                    size_mm=round(size_mm, 2),
                    height_mm=round(height_mm, 2),
                )
            )


def draw_extras(rng: np.random.Generator, spec: MotorSpec) -> MotorSpec:
    """Give a motor with bolts its distractors."""
    draw = _Draw(rng, spec, lay_out(spec))
    _reserve(draw)
    _on_cap(draw)
    _on_bracket(draw)
    _on_solenoid_cap(draw)
    _on_yoke(draw)
    return spec.model_copy(update={"distractors": tuple(draw.items)})


def _reserve(draw: _Draw) -> None:
    """Bolts, studs, plug and grommet keep their places."""
    spec, layout = draw.spec, draw.layout
    for bolt in spec.bolts:
        at_solenoid = bolt.site.value.startswith("solenoid")
        origin = layout.solenoid_xy if at_solenoid else (0.0, 0.0)
        room = draw.top if bolt.site.value.endswith("front") else draw.bottom
        room.take(
            bolt.radius_mm,
            bolt.angle_deg,
            build_bolt(bolt).head_diameter_mm / 2 + _LUG_MM,
            origin,
        )
    origin = layout.terminal_xy
    for stud in spec.terminals.studs:
        draw.bottom.take(stud.radius_mm, stud.angle_deg, 1.3 * stud.thread_mm, origin)
    plug = spec.terminals.plug
    if plug is not None and not plug.on_side:
        draw.bottom.take(plug.radius_mm, plug.angle_deg, 0.6 * max(plug.size_mm[:2]), origin)
    for ear in spec.bracket.ears:
        draw.top.take(ear.reach_mm, ear.angle_deg, 0.5 * ear.hole_mm + 2)


def _group(
    draw: _Draw,
    kind: DistractorKind,
    site: Site,
    *,
    ring_mm: tuple[float, float],
    size_mm: tuple[float, float],
    height_mm: tuple[float, float],
    centre_mm: tuple[float, float] = (0.0, 0.0),
    count: tuple[int, int] = (1, _MAX_PER_SITE),
) -> None:
    """Several alike in a ring, where the ring is wide enough."""
    rng = draw.rng
    size, height = between(rng, *size_mm), between(rng, *height_mm)
    low, high = ring_mm[0] + size / 2, ring_mm[1] - size / 2
    if high <= low:
        return
    reach = between(rng, low, high)
    number, start = whole(rng, *count), between(rng, 0, 360)
    for index in range(number):
        angle = math.radians(start + 360 * index / number + between(rng, -6, 6))
        xy = (centre_mm[0] + reach * math.cos(angle), centre_mm[1] + reach * math.sin(angle))
        draw.add(kind, site, xy, size, height)


def _on_cap(draw: _Draw) -> None:
    rng, cap = draw.rng, draw.spec.rear_cap
    if cap.style == "spider":
        return
    hub = cap.hub_radius_mm + 3 if cap.hub_height_mm > 0 else 3.0
    ring = (hub, draw.layout.cap_radius_mm - cap.edge_mm - 0.5)
    deep = max(1.5, min(0.5 * cap.length_mm, 8.0))
    if happens(rng, 0.3):
        _group(
            draw,
            DistractorKind.RIVET,
            Site.REAR_CAP,
            ring_mm=ring,
            size_mm=(4, 8),
            height_mm=(0.8, 2.2),
        )
    if happens(rng, 0.3):
        _group(
            draw,
            DistractorKind.HOLE,
            Site.REAR_CAP,
            ring_mm=ring,
            size_mm=(3.3, 7),
            height_mm=(1.5, deep),
        )
    if happens(rng, 0.3):
        _group(
            draw,
            DistractorKind.BOSS,
            Site.REAR_CAP,
            ring_mm=ring,
            size_mm=(6, 14),
            height_mm=(0.8, 4),
        )
    if happens(rng, 0.22):
        _group(
            draw,
            DistractorKind.NUT,
            Site.REAR_CAP,
            ring_mm=ring,
            size_mm=(7, 10),
            height_mm=(3, 6),
            count=(1, 2),
        )
    if happens(rng, 0.12):
        _group(
            draw,
            DistractorKind.DOWEL,
            Site.REAR_CAP,
            ring_mm=ring,
            size_mm=(3, 6),
            height_mm=(1, 4),
            count=(1, 2),
        )


def _on_bracket(draw: _Draw) -> None:
    rng, bracket = draw.rng, draw.spec.bracket
    ring = (bracket.nose.radius_mm + 5, draw.layout.flange_radius_mm - 1.5)
    centre = draw.layout.shaft_xy
    deep = max(1.5, min(0.7 * bracket.flange_mm, 9.0))
    if happens(rng, 0.4):
        _group(
            draw,
            DistractorKind.HOLE,
            Site.BRACKET_FRONT,
            ring_mm=ring,
            size_mm=(4, 8.5),
            height_mm=(2, deep),
            centre_mm=centre,
        )
    if happens(rng, 0.35):
        _group(
            draw,
            DistractorKind.BOSS,
            Site.BRACKET_FRONT,
            ring_mm=ring,
            size_mm=(6, 14),
            height_mm=(0.8, 5),
            centre_mm=centre,
        )
    if happens(rng, 0.25):
        _group(
            draw,
            DistractorKind.DOWEL,
            Site.BRACKET_FRONT,
            ring_mm=ring,
            size_mm=(4, 9),
            height_mm=(2, 8),
            centre_mm=centre,
            count=(1, 2),
        )
    if happens(rng, 0.12):
        _group(
            draw,
            DistractorKind.NUT,
            Site.BRACKET_FRONT,
            ring_mm=ring,
            size_mm=(8, 13),
            height_mm=(4, 7),
            centre_mm=centre,
            count=(1, 2),
        )


def _on_solenoid_cap(draw: _Draw) -> None:
    rng, solenoid = draw.rng, draw.spec.solenoid
    if solenoid is None or not happens(rng, 0.5):
        return
    reach = 0.8 if solenoid.cap_style == "round" else 0.68
    kind = one_of(rng, (DistractorKind.RIVET, DistractorKind.BOSS, DistractorKind.HOLE))
    _group(
        draw,
        kind,
        Site.SOLENOID_CAP,
        ring_mm=(2.0, reach * draw.layout.solenoid_cap_radius_mm),
        size_mm=(3.5, 8),
        height_mm=(0.8, 2.5),
    )


def _on_yoke(draw: _Draw) -> None:
    """Pole screws in rows, rivets, a stud with its nut."""
    rng, housing = draw.rng, draw.spec.housing
    items = draw.items
    if happens(rng, 0.45):
        count, start = one_of(rng, (2, 4, 4)), between(rng, 0, 360, 1)
        size = min(between(rng, 0.24, 0.4) * housing.radius_mm, 20.0)
        rows = [0.5] if housing.length_mm < 3.0 * housing.radius_mm else [0.3, 0.7]
        proud = between(rng, 0, 0.8)
        items += [
            DistractorSpec(
                kind=DistractorKind.POLE_SCREW,
                site=Site.YOKE,
                angle_deg=round(start + 360 * index / count, 1),
                z_mm=round(row * housing.length_mm, 1),
                size_mm=round(size, 1),
                height_mm=proud,
            )
            for index in range(count)
            for row in rows
        ]
    elif happens(rng, 0.35):
        kind = one_of(rng, (DistractorKind.RIVET, DistractorKind.HOLE, DistractorKind.BOSS))
        row, start = between(rng, 0.08, 0.92), between(rng, 0, 360, 1)
        size, height = between(rng, 3.5, 8), between(rng, 0.6, 2.0)
        count = whole(rng, 1, 4)
        items += [
            DistractorSpec(
                kind=kind,
                site=Site.YOKE,
                angle_deg=round(start + 360 * index / count, 1),
                z_mm=round(row * housing.length_mm, 1),
                size_mm=size,
                height_mm=height,
            )
            for index in range(count)
        ]
    if happens(rng, 0.4 if draw.spec.solenoid is None else 0.08):
        items.append(
            DistractorSpec(
                kind=DistractorKind.NUT,
                site=Site.YOKE,
                angle_deg=between(rng, 0, 360, 1),
                z_mm=round(between(rng, 0.75, 0.92) * housing.length_mm, 1),
                size_mm=one_of(rng, (8.0, 10.0, 13.0)),
                height_mm=between(rng, 3.5, 6.5),
            )
        )
