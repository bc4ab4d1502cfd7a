"""Draws where bolts sit on a motor of one family, and which they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from boltpose.factory.bolts import build_bolt
from boltpose.factory.draws import Room, between, happens, one_of, whole
from boltpose.factory.layout import Layout, lay_out
from boltpose.factory.plans import FamilyPlan
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind, Site

_HEADS = (
    HeadKind.HEX,
    HeadKind.HEX,
    HeadKind.HEX_FLANGE,
    HeadKind.HEX_FLANGE,
    HeadKind.SOCKET_CAP,
    HeadKind.TORX_PAN,
    HeadKind.TORX_PAN,
    HeadKind.PHILLIPS_PAN,
    HeadKind.SLOTTED,
)
_HEX_LIKE = (HeadKind.HEX, HeadKind.HEX_FLANGE, HeadKind.SOCKET_CAP, HeadKind.TORX_PAN)
_AIR_MM = 1.5
"""Between the circles around two heads."""


@dataclass
class _Draw:
    """One motor's draw in progress."""

    rng: np.random.Generator
    plan: FamilyPlan
    spec: MotorSpec
    layout: Layout
    bolts: list[BoltSpec] = field(default_factory=list)
    top: Room = field(default_factory=Room)
    bottom: Room = field(default_factory=Room)

    def thread(self, *, largest: int = 8, smallest: int = 4) -> int:
        """A thread diameter that the family uses, within limits."""
        fitting = [size for size in self.plan.threads if smallest <= size <= largest]
        return one_of(self.rng, fitting) if fitting else smallest

    def head_mm(self, bolt: BoltSpec) -> float:
        """Radius of the circle around a bolt's head."""
        return build_bolt(bolt).head_diameter_mm / 2

    def add(self, group: list[BoltSpec]) -> None:
        """Take those of a group that have room, up to the family's number of bolts."""
        for bolt in group:
            if len(self.bolts) >= self.plan.bolts[1]:
                return
            at_solenoid = bolt.site.value.startswith("solenoid")
            origin = self.layout.solenoid_xy if at_solenoid else (0.0, 0.0)
            is_top = bolt.site.value.endswith("front")
            room = self.top if is_top else self.bottom
            size = self.head_mm(bolt) + _AIR_MM
            if room.take(bolt.radius_mm, bolt.angle_deg, size, origin):
                self.bolts.append(bolt)


def draw_bolts(rng: np.random.Generator, plan: FamilyPlan, spec: MotorSpec) -> MotorSpec:
    """Give a motor its bolts."""
    draw = _Draw(rng, plan, spec, lay_out(spec))
    _reserve_terminals(draw)
    _through_bolts(draw)
    groups = [_cap_screws, _front_screws, _rim_bolts, _ring_bolts, _nose_screws]
    if spec.solenoid is not None:
        _solenoid_mount(draw)
        groups.append(_solenoid_cap_screws)
    wanted = max(whole(rng, *plan.bolts), len(draw.bolts))
    for index in rng.permutation(len(groups)):
        if len(draw.bolts) < wanted:
            groups[int(index)](draw)
    return spec.model_copy(update={"bolts": tuple(_used(draw, bolt) for bolt in draw.bolts)})


def _used(draw: _Draw, bolt: BoltSpec) -> BoltSpec:
    """What happened to a bolt since it was new."""
    rng = draw.rng
    update: dict[str, object] = {
        "roll_deg": between(rng, 0, 360, 1),
        "rusty": happens(rng, 0.2),
        "clogged": between(rng, 0.2, 1.0) if happens(rng, 0.25) else 0.0,
    }
    if bolt.head in (HeadKind.HEX, HeadKind.HEX_FLANGE) and happens(rng, 0.3):
        update["dish_mm"] = between(rng, 0.3, 1.2)
    if happens(rng, 0.02):
        update["state"] = "missing"
    return bolt.model_copy(update=update)


def _kind(draw: _Draw, thread: int, *, heads: tuple[HeadKind, ...] = _HEADS) -> dict[str, object]:
    """Head, thread and now and then an own spanner size, common to a group."""
    head = one_of(draw.rng, heads)
    return {
        "head": head,
        "thread_mm": thread,
        "washer": head in (HeadKind.HEX, HeadKind.SOCKET_CAP) and happens(draw.rng, 0.2),
    }


def _bolt(kind: dict[str, object], **fields: object) -> BoltSpec:
    return BoltSpec.model_validate({**kind, **fields})


def _ring(draw: _Draw, count: int, start_deg: float, jitter_deg: float = 4) -> list[float]:
    """Directions around, nearly even."""
    rng = draw.rng
    return [
        round(start_deg + 360 * index / count + float(rng.uniform(-jitter_deg, jitter_deg)), 1)
        for index in range(count)
    ]


def _reserve_terminals(draw: _Draw) -> None:
    """Studs, plug and cable keep heads away."""
    terminals, origin = draw.spec.terminals, draw.layout.terminal_xy
    for index, stud in enumerate(terminals.studs):
        has_cable = terminals.cable is not None and terminals.cable.stud == index
        size = 1.25 * stud.thread_mm + (3 if has_cable else 0.5)
        draw.bottom.take(stud.radius_mm, stud.angle_deg, size, origin)
    if terminals.plug is not None and not terminals.plug.on_side:
        size = 0.6 * max(terminals.plug.size_mm[:2])
        draw.bottom.take(terminals.plug.radius_mm, terminals.plug.angle_deg, size, origin)


def _through_bolts(draw: _Draw) -> None:
    """Two to four long bolts from the rear cap to what stands before the yoke."""
    rng, spec = draw.rng, draw.spec
    radius = spec.housing.radius_mm
    count = one_of(rng, (2, 2, 2, 3, 4))
    smallest = 5 if radius > 28 else 4
    kind = _kind(draw, draw.thread(smallest=smallest), heads=_HEX_LIKE)
    head = draw.head_mm(_bolt(kind, site=Site.REAR_CAP, radius_mm=1, angle_deg=0))
    outside = happens(rng, draw.plan.outer_through_bolts)
    if outside:
        reach = radius + 0.5 * int(str(kind["thread_mm"])) + between(rng, 0.8, 3)
    else:
        reach = draw.layout.cap_radius_mm - head - between(rng, 0.5, 3.5) - spec.rear_cap.edge_mm
        reach = max(reach, 0.55 * radius)
    full = spec.housing.length_mm + spec.rear_cap.length_mm
    depth = spec.bracket.body_length_mm if spec.gearbox is None else spec.gearbox.length_mm
    shank = min(round(full + between(rng, 4, max(min(10.0, depth - 4), 4.5)), 1), 249.0)
    recess = between(rng, 1, 4, 1) if not outside and happens(rng, 0.25) else 0.0
    start = between(rng, 0, 360, 1) if not outside else between(rng, -25, 25, 1)
    draw.add(
        [
            _bolt(
                kind,
                site=Site.REAR_CAP,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=shank,
                recess_mm=min(recess, round(0.3 * spec.rear_cap.length_mm, 1)),
            )
            for angle in _ring(draw, count, start)
        ]
    )


def _cap_screws(draw: _Draw) -> None:
    """Small screws that hold the brush plate or the bearing's lid."""
    rng, spec = draw.rng, draw.spec
    if spec.rear_cap.style == "spider" or not happens(rng, 0.65):
        return
    kind = _kind(draw, draw.thread(largest=5))
    head = draw.head_mm(_bolt(kind, site=Site.REAR_CAP, radius_mm=1, angle_deg=0))
    low = spec.rear_cap.hub_radius_mm + head + 2
    high = draw.layout.cap_radius_mm - head - spec.rear_cap.edge_mm - 1
    if high < low:
        return
    reach = between(rng, low, min(high, low + 12), 1)
    start = between(rng, 0, 360, 1)
    draw.add(
        [
            _bolt(
                kind,
                site=Site.REAR_CAP,
                radius_mm=reach,
                angle_deg=angle,
                shank_mm=min(10.0, 2 + round(0.6 * spec.rear_cap.length_mm, 1)),
            )
            for angle in _ring(draw, whole(rng, 2, 3), start)
        ]
    )


def _front_screws(draw: _Draw) -> None:
    """Bolts around the nose in the front of the flange, in lugs where they reach out."""
    rng, spec = draw.rng, draw.spec
    if not happens(rng, 0.6):
        return
    kind = _kind(draw, draw.thread(), heads=_HEX_LIKE)
    head = draw.head_mm(_bolt(kind, site=Site.BRACKET_FRONT, radius_mm=1, angle_deg=0))
    nose = spec.bracket.nose.radius_mm + 4
    low = nose + head + 1.5
    high = max(draw.layout.flange_radius_mm - head - 1, low + 0.5)
    count = one_of(rng, (2, 3, 3, 4))
    centre = draw.layout.shaft_xy
    bolts: list[BoltSpec] = []
    for angle in _ring(draw, count, between(rng, 0, 360, 1), 6):
        reach = between(rng, low, min(high, low + 6))
        x = centre[0] + reach * math.cos(math.radians(angle))
        y = centre[1] + reach * math.sin(math.radians(angle))
        if _hits_ear(draw, x, y, head):
            continue
        bolts.append(
            _bolt(
                kind,
                site=Site.BRACKET_FRONT,
                radius_mm=round(math.hypot(x, y), 2),
                angle_deg=round(math.degrees(math.atan2(y, x)), 2),
                shank_mm=round(spec.bracket.body_length_mm * 0.8, 1),
                recess_mm=between(rng, 1, 5, 1) if happens(rng, 0.35) else 0.0,
            )
        )
    draw.add(bolts)


def _hits_ear(draw: _Draw, x: float, y: float, head_mm: float) -> bool:
    """Whether a head would stand over an ear's hole."""
    for ear in draw.spec.bracket.ears:
        ex = ear.reach_mm * math.cos(math.radians(ear.angle_deg))
        ey = ear.reach_mm * math.sin(math.radians(ear.angle_deg))
        if math.hypot(x - ex, y - ey) < head_mm + 0.5 * ear.hole_mm + 2:
            return True
    return False


def _rim_bolts(draw: _Draw) -> None:
    """Bolts in the rim behind the flange, heads forward, some of them under ears."""
    rng, spec = draw.rng, draw.spec
    room = spec.bracket.body_length_mm - spec.bracket.flange_mm - 8
    if room < 5 or not happens(rng, 0.5) or draw.layout.shaft_xy != (0.0, 0.0):
        return
    kind = _kind(draw, draw.thread(largest=5 if room < 8 else 6))
    head = draw.head_mm(_bolt(kind, site=Site.RIM_FRONT, radius_mm=1, angle_deg=0))
    behind = spec.housing.radius_mm if spec.gearbox is None else spec.gearbox.radius_mm
    reach = max(behind - 0.5 * head, spec.bracket.radius_mm + head + 0.5)
    ears = [ear.angle_deg for ear in spec.bracket.ears]
    angles = _ring(draw, one_of(rng, (2, 3, 4)), one_of(rng, ears) + between(rng, -10, 10, 1))
    draw.add(
        [
            _bolt(
                kind,
                site=Site.RIM_FRONT,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=between(rng, 12, 18, 1),
            )
            for angle in angles
            if not _is_at_solenoid(draw, reach, angle, head)
        ]
    )


def _ring_bolts(draw: _Draw) -> None:
    """Bolts beside the yoke into the gearbox ring or the bracket, heads to the rear."""
    rng, spec = draw.rng, draw.spec
    if not happens(rng, 0.75 if spec.gearbox is not None else 0.45):
        return
    kind = _kind(draw, draw.thread(), heads=_HEX_LIKE)
    head = draw.head_mm(_bolt(kind, site=Site.GEARBOX_REAR, radius_mm=1, angle_deg=0))
    reach = spec.housing.radius_mm + head + between(rng, 0.9, 2.5)
    if spec.gearbox is not None:
        reach = max(reach, spec.gearbox.radius_mm - head)
        depth = spec.gearbox.length_mm + between(rng, 4, 10, 1)
    else:
        depth = spec.bracket.body_length_mm * 0.8
    angles = _ring(draw, one_of(rng, (2, 3, 3, 4)), between(rng, 0, 360, 1), 8)
    draw.add(
        [
            _bolt(
                kind,
                site=Site.GEARBOX_REAR,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=round(max(depth, 6.0), 1),
            )
            for angle in angles
            if not _is_at_solenoid(draw, reach, angle, head)
        ]
    )


def _is_at_solenoid(draw: _Draw, radius_mm: float, angle_deg: float, head_mm: float) -> bool:
    """Whether a head would stand in the solenoid or its pad."""
    solenoid = draw.spec.solenoid
    if solenoid is None:
        return False
    x = radius_mm * math.cos(math.radians(angle_deg))
    y = radius_mm * math.sin(math.radians(angle_deg)) - solenoid.offset_mm
    wide = max(solenoid.radius_mm, solenoid.flange_radius_mm or 0)
    return math.hypot(x, y) < wide + head_mm + 3


def _nose_screws(draw: _Draw) -> None:
    """Small screws in the front of a closed nose, where it is wide enough."""
    rng, spec = draw.rng, draw.spec
    nose = spec.bracket.nose
    if nose.style != "closed" or not happens(rng, 0.6):
        return
    kind = _kind(draw, 4)
    head = draw.head_mm(_bolt(kind, site=Site.NOSE_FRONT, radius_mm=1, angle_deg=0))
    boss = min(0.72 * nose.tip_radius_mm, spec.gear.shaft_radius_mm + 6.5)
    low, high = boss + head + 0.6, nose.tip_radius_mm - head - 0.3
    if high < low or draw.layout.shaft_xy != (0.0, 0.0):
        return
    draw.add(
        [
            _bolt(
                kind,
                site=Site.NOSE_FRONT,
                radius_mm=between(rng, low, high),
                angle_deg=angle,
                shank_mm=6,
            )
            for angle in _ring(draw, whole(rng, 2, 3), between(rng, 0, 360, 1))
        ]
    )


def _solenoid_mount(draw: _Draw) -> None:
    """Two or three bolts that hold the solenoid: through the pad, or through its own flange."""
    rng, solenoid = draw.rng, draw.spec.solenoid
    assert solenoid is not None
    kind = _kind(draw, draw.thread(smallest=5), heads=_HEX_LIKE)
    head = draw.head_mm(_bolt(kind, site=Site.SOLENOID_FRONT, radius_mm=1, angle_deg=0))
    tilt = between(rng, -14, 40, 1)
    angles = [tilt, 180 - tilt] + ([90.0] if happens(rng, 0.35) else [])
    has_flange = solenoid.flange_radius_mm is not None and happens(rng, 0.6)
    if has_flange or draw.plan.gear_train == "coaxial":
        site, reach = Site.SOLENOID_REAR, solenoid.radius_mm + head + between(rng, 0.8, 2.5)
        shank = solenoid.flange_mm + 0.7 * solenoid.pad_mm
    else:
        site, reach = Site.SOLENOID_FRONT, solenoid.radius_mm * between(rng, 0.82, 1.1)
        shank = solenoid.pad_mm + between(rng, 4, 9)
        if solenoid.plunger_boot:
            reach = max(reach, 0.6 * solenoid.radius_mm + head + 1)
    draw.add(
        [
            _bolt(
                kind,
                site=site,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=round(max(shank, 4.0), 1),
            )
            for angle in angles
        ]
    )


def _solenoid_cap_screws(draw: _Draw) -> None:
    """Two or three screws through the plastic cap."""
    rng, solenoid = draw.rng, draw.spec.solenoid
    assert solenoid is not None
    if not happens(rng, 0.7):
        return
    kind = _kind(draw, draw.thread(largest=5))
    head = draw.head_mm(_bolt(kind, site=Site.SOLENOID_CAP, radius_mm=1, angle_deg=0))
    reach = 0.86 * draw.layout.solenoid_cap_radius_mm - head - between(rng, 0.4, 1.5)
    if solenoid.cap_style != "round" or reach < head + 4:
        reach = 0.74 * draw.layout.solenoid_cap_radius_mm - head
    if reach < 6:
        return
    depth = min(solenoid.cap_length_mm - 3, 14.0)
    count = whole(rng, 2, 4)
    origin = draw.layout.solenoid_xy
    starts = [between(rng, 0, 360, 1) for _ in range(12)]
    # the turn that leaves most of the screws clear of studs and plug
    clear = [
        sum(
            draw.bottom.is_free(reach, start + 360 * index / count, head + _AIR_MM + 1, origin)
            for index in range(count)
        )
        for start in starts
    ]
    start = starts[clear.index(max(clear))]
    draw.add(
        [
            _bolt(
                kind,
                site=Site.SOLENOID_CAP,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=round(max(depth, 3.0), 1),
                recess_mm=between(rng, 0.5, 3, 1) if happens(rng, 0.4) else 0.0,
            )
            for angle in _ring(draw, count, start, 2)
        ]
    )
