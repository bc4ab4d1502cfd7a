"""Refuses motors that cannot be, in words that name the field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from boltpose.errors import ConfigError
from boltpose.factory.bolts import BoltSolid
from boltpose.factory.gear import tooth_radii
from boltpose.factory.layout import Layout
from boltpose.factory.nose import room_radius_mm
from boltpose.factory.pieces import Piece
from boltpose.factory.sites import Body, Seat
from boltpose.factory.solids import Manifold, boxes_touch, cylinder
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec

_GAP_MM = 0.3
_MAX_BURIED = 0.03
"""Share of a head that play may cut out of a neighbour it is not mounted on."""
_MIN_SUPPORT = 0.55
"""Share of the seat, a hole's chamfer and rounded lug edges taken off, that must be material."""


class BoltPlaceError(ConfigError):
    """A bolt cannot be where the specification wants it."""

    def __init__(self, index: int, problem: str) -> None:
        super().__init__(f"bolts[{index}]: {problem}")
        self.index = index
        """Of the bolt in `MotorSpec.bolts`."""


class SeatedBolt(Protocol):
    """What the checks need of a placed bolt."""

    @property
    def spec(self) -> BoltSpec:
        """How it was asked for."""
        ...

    @property
    def index(self) -> int:
        """Of its specification."""
        ...

    @property
    def solid(self) -> BoltSolid:
        """Its body and sizes."""
        ...

    @property
    def seat(self) -> Seat:
        """Where it sits."""
        ...

    def place(self, body: Manifold) -> Manifold:
        """Move a body from frame `bolt` to frame `build`."""
        ...


def check_layout(spec: MotorSpec, layout: Layout) -> None:
    """Refuse bodies that would stand in each other.

    Raises:
        ConfigError: Something does not fit.
    """
    solenoid = spec.solenoid
    if solenoid is not None and solenoid.front_mm > -spec.housing.length_mm:
        widest = spec.housing.radius_mm + 0.5 * spec.housing.ovality_mm + _GAP_MM
        room = solenoid.offset_mm - widest
        if solenoid.radius_mm > room and layout.can_rear_z < 0:
            raise ConfigError(
                f"solenoid.offset_mm: {solenoid.offset_mm:g} leaves {room:.3g} mm beside the yoke, "
                f"the solenoid's radius is {solenoid.radius_mm:g}"
            )
    nose = spec.bracket.nose
    if nose.tip_radius_mm > nose.radius_mm:
        raise ConfigError(
            f"bracket.nose.tip_radius_mm: {nose.tip_radius_mm:g} is more than the foot's "
            f"{nose.radius_mm:g}"
        )
    if nose.wall_mm > nose.tip_radius_mm - spec.gear.shaft_radius_mm:
        raise ConfigError(f"bracket.nose.wall_mm: {nose.wall_mm:g} leaves no room for the shaft")
    if nose.style != "stub" and nose.length_mm < 1.1 * nose.wall_mm + 5:
        raise ConfigError(
            f"bracket.nose.length_mm: {nose.length_mm:g} is too short for a wall of "
            f"{nose.wall_mm:g}"
        )
    if spec.bracket.flange_mm > spec.bracket.body_length_mm:
        raise ConfigError(
            f"bracket.flange_mm: {spec.bracket.flange_mm:g} is more than body_length_mm, "
            f"{spec.bracket.body_length_mm:g}"
        )
    _check_gear(spec, layout)


def _check_gear(spec: MotorSpec, layout: Layout) -> None:
    gear, nose = spec.gear, spec.bracket.nose
    clutch_low = layout.flange_front_z + gear.gap_mm
    pinion_low = clutch_low + gear.clutch_length_mm
    pinion_high = pinion_low + gear.width_mm
    _, tip = tooth_radii(gear)
    if nose.style == "stub":
        if clutch_low < layout.nose_front_z:
            _check_room(spec, layout, "clutch_radius_mm", gear.clutch_radius_mm, clutch_low)
        if pinion_low < layout.nose_front_z:
            _check_room(spec, layout, "module_mm", tip, pinion_low)
        return
    ceiling = layout.nose_front_z - 1.1 * nose.wall_mm
    if pinion_high > ceiling:
        raise ConfigError(
            f"gear.width_mm: the pinion ends {pinion_high - layout.flange_front_z:.4g} mm in front "
            f"of the flange, the nose has room for {ceiling - layout.flange_front_z:.4g}"
        )
    _check_room(spec, layout, "clutch_radius_mm", gear.clutch_radius_mm, pinion_low)
    if nose.style == "closed":
        _check_room(spec, layout, "module_mm", tip, pinion_high)


def _check_room(spec: MotorSpec, layout: Layout, field: str, radius_mm: float, z: float) -> None:
    room = room_radius_mm(spec, layout, z)
    if radius_mm + _GAP_MM > room:
        raise ConfigError(
            f"gear.{field}: needs a radius of {radius_mm:.4g} mm, the nose has {room:.4g} there"
        )


def check_bolts(spec: MotorSpec, bolts: Sequence[SeatedBolt]) -> None:
    """Refuse bolts that stand in each other, and ids given twice.

    Raises:
        ConfigError: They do.
    """
    ids = [bolt.id for bolt in spec.bolts if bolt.id is not None]
    for name in ids:
        if ids.count(name) > 1:
            raise ConfigError(f"bolts: the id {name} is given twice")
    for index, first in enumerate(bolts):
        for second in bolts[index + 1 :]:
            _check_pair(first, second)


def _check_pair(first: SeatedBolt, second: SeatedBolt) -> None:
    distance = math.dist(first.seat.centre_mm[:2], second.seat.centre_mm[:2])
    for radius_a, low_a, high_a in _sections(first):
        for radius_b, low_b, high_b in _sections(second):
            if distance < radius_a + radius_b + 2 * _GAP_MM and low_a < high_b and low_b < high_a:
                raise BoltPlaceError(
                    second.index,
                    f"{distance:.3g} mm beside bolts[{first.index}], they need "
                    f"{radius_a + radius_b + 2 * _GAP_MM:.3g}",
                )


def _sections(bolt: SeatedBolt) -> list[tuple[float, float, float]]:
    """Head and shank as (radius, lowest z, highest z)."""
    z, way = bolt.seat.centre_mm[2], bolt.seat.outward[2]
    solid = bolt.solid
    ends = [
        (solid.head_diameter_mm / 2, z, z + way * solid.head_height_mm),
        (solid.shank_radius_mm, z, z - way * (solid.shank_mm + 1)),
    ]
    return [(radius, min(a, b), max(a, b)) for radius, a, b in ends]


def check_seat(
    bolt: SeatedBolt, obstacles: Sequence[tuple[str, Manifold]], pieces: Sequence[Piece]
) -> None:
    """Refuse bolts inside another part, and heads over thin air.

    Args:
        bolt: The bolt.
        obstacles: Names and bodies of what no bolt may touch: gear and terminals.
        pieces: What carries bolts, before anything is cut out of it.

    Raises:
        BoltPlaceError: It is one of them.
    """
    solid = bolt.solid
    radius, height = solid.head_diameter_mm / 2, solid.head_height_mm
    head = bolt.place(cylinder(radius, -height, 0))
    shank = bolt.place(cylinder(solid.shank_radius_mm, -height - solid.shank_mm, -height))
    for name, body in obstacles:
        for own in (head, shank):
            if boxes_touch(own, body) and (own ^ body).volume() > 0.01:
                raise BoltPlaceError(bolt.index, f"it stands in the {name}")
    ring = bolt.place(
        cylinder(radius - 0.4, -height - 0.3, -height - 0.05)
        - cylinder(solid.shank_radius_mm + 0.3, -height - 1, 1)
    )
    support = 0.0
    for piece in pieces:
        if piece.body is bolt.seat.body:
            support += (ring ^ piece.shape).volume()
        # play around a head may eat into castings, as a spot face does
        elif piece.body not in (None, Body.BRACKET) and boxes_touch(head, piece.shape):
            buried = (head ^ piece.shape).volume() / head.volume()
            if buried > _MAX_BURIED:
                raise BoltPlaceError(
                    bolt.index, f"{100 * buried:.0f} % of its head are inside {piece.name}"
                )
    share = support / ring.volume()
    if share < _MIN_SUPPORT:
        raise BoltPlaceError(
            bolt.index,
            f"its head has no seat, only {100 * share:.0f} % of it are on the "
            f"{bolt.seat.body.value}",
        )
