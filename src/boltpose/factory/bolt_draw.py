"""A draw of bolts in progress: who has which place, which head and thread."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from boltpose.factory.bolts import build_bolt
from boltpose.factory.draws import Room, between, happens, one_of
from boltpose.factory.head_sizes import HEAD_SIZES
from boltpose.factory.layout import Layout
from boltpose.factory.plans import FamilyPlan
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind

HEADS = (
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
SMALL_HEXAGONS = {6: 8.0, 8: 12.0}
"""Spanner sizes of small-flange and Japanese bolts by thread."""
HEX_LIKE = (HeadKind.HEX, HeadKind.HEX_FLANGE, HeadKind.SOCKET_CAP, HeadKind.TORX_PAN)
AIR_MM = 1.5
"""Between the circles around two heads."""


@dataclass
class BoltDraw:
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
            size = self.head_mm(bolt) + AIR_MM
            if room.take(bolt.radius_mm, bolt.angle_deg, size, origin):
                self.bolts.append(bolt)


def bolt_kind(
    draw: BoltDraw, thread: int, *, heads: tuple[HeadKind, ...] = HEADS
) -> dict[str, object]:
    """Head, thread and now and then sizes beside the standard, common to a group."""
    rng = draw.rng
    head = one_of(rng, heads)
    size = HEAD_SIZES[head][thread]
    kind: dict[str, object] = {
        "head": head,
        "thread_mm": thread,
        "washer": head in (HeadKind.HEX, HeadKind.SOCKET_CAP) and happens(rng, 0.2),
    }
    if happens(rng, 0.3):
        kind["head_height_mm"] = round(size.height_mm * between(rng, 0.82, 1.2), 2)
    if head in (HeadKind.HEX, HeadKind.HEX_FLANGE):
        if thread in SMALL_HEXAGONS and happens(rng, 0.25):
            kind["across_mm"] = SMALL_HEXAGONS[thread]
    elif happens(rng, 0.3):
        kind["across_mm"] = round(max(size.across_mm * between(rng, 0.9, 1.1), thread + 2.0), 2)
    return kind


def make_bolt(kind: dict[str, object], **fields: object) -> BoltSpec:
    """A specification from what a group shares and what is its own."""
    return BoltSpec.model_validate({**kind, **fields})


def ring(draw: BoltDraw, count: int, start_deg: float, jitter_deg: float = 4) -> list[float]:
    """Directions around, nearly even."""
    rng = draw.rng
    return [
        round(start_deg + 360 * index / count + float(rng.uniform(-jitter_deg, jitter_deg)), 1)
        for index in range(count)
    ]


def reserve_terminals(draw: BoltDraw) -> None:
    """Studs, plug and cable keep heads away."""
    terminals, origin = draw.spec.terminals, draw.layout.terminal_xy
    for index, stud in enumerate(terminals.studs):
        has_cable = terminals.cable is not None and terminals.cable.stud == index
        size = 1.25 * stud.thread_mm + (3 if has_cable else 0.5)
        draw.bottom.take(stud.radius_mm, stud.angle_deg, size, origin)
    if terminals.plug is not None and not terminals.plug.on_side:
        size = 0.6 * max(terminals.plug.size_mm[:2])
        draw.bottom.take(terminals.plug.radius_mm, terminals.plug.angle_deg, size, origin)


def hits_ear(draw: BoltDraw, x: float, y: float, head_mm: float) -> bool:
    """Whether a head would stand over an ear's hole."""
    for ear in draw.spec.bracket.ears:
        ex = ear.reach_mm * math.cos(math.radians(ear.angle_deg))
        ey = ear.reach_mm * math.sin(math.radians(ear.angle_deg))
        if math.hypot(x - ex, y - ey) < head_mm + 0.5 * ear.hole_mm + 2:
            return True
    return False


def is_at_solenoid(draw: BoltDraw, radius_mm: float, angle_deg: float, head_mm: float) -> bool:
    """Whether a head would stand in the solenoid or its pad."""
    solenoid = draw.spec.solenoid
    if solenoid is None:
        return False
    x = radius_mm * math.cos(math.radians(angle_deg))
    y = radius_mm * math.sin(math.radians(angle_deg)) - solenoid.offset_mm
    wide = max(solenoid.radius_mm, solenoid.flange_radius_mm or 0)
    return math.hypot(x, y) < wide + head_mm + 3
