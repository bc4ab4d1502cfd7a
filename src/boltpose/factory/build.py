"""`build_motor`: from a specification to disjoint watertight solids and true bolt poses.

Where two parts want the same place, the one further up this list keeps it and the other is cut:
bolts, gear, terminals, solenoid, main housing, gearbox, bracket. What is cut like that by more
than play is a mistake in the specification and refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.factory.bolts import BoltSolid, bolt_clearance, build_bolt, rod_name, split_bolt
from boltpose.factory.bracket import build_bracket
from boltpose.factory.castings import largest_piece
from boltpose.factory.checks import BoltPlaceError, check_bolts, check_layout, check_seat
from boltpose.factory.distractors import build_distractor
from boltpose.factory.gear import GearSolid, build_gear
from boltpose.factory.gearbox import build_gearbox
from boltpose.factory.housing import build_yoke
from boltpose.factory.layout import Layout, lay_out
from boltpose.factory.model import Material, MotorModel, SolidPart, TrueBolt
from boltpose.factory.nose import cavity_floor_z
from boltpose.factory.pieces import Piece
from boltpose.factory.rear_cap import build_rear_cap
from boltpose.factory.sites import Lug, Seat, find_lugs, find_seat
from boltpose.factory.solenoid import build_solenoid
from boltpose.factory.solids import Manifold, boxes_touch, manifold_of, settled, solid_part, union
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec
from boltpose.factory.terminals import build_terminals
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part, Side

_TURNED_OVER = np.diag([1.0, -1.0, -1.0])
"""Rotation to a head that looks along -z."""
_CRUMB_MM3 = 2.0
"""Cuts leave crumbs; smaller ones than this are dropped everywhere."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedBolt:
    """A bolt in frame `build`, before it has its name."""

    spec: BoltSpec
    index: int
    """Of its specification."""
    solid: BoltSolid
    seat: Seat
    build_from_bolt: Transform

    def place(self, body: Manifold) -> Manifold:
        """Move a body from frame `bolt` to frame `build`."""
        return body.transform(self.build_from_bolt.matrix[:3])


def build_motor(spec: MotorSpec) -> MotorModel:
    """Build a motor.

    Returns:
        Disjoint watertight parts and the bolts' true poses in frame `motor`.

    Raises:
        ConfigError: The specification asks for what cannot be; the text names its field.
    """
    layout = lay_out(spec)
    check_layout(spec, layout)
    bolts = [_place_bolt(spec, layout, index) for index in range(len(spec.bolts))]
    check_bolts(spec, bolts)
    lugs = [
        lug for bolt in bolts for lug in find_lugs(spec, layout, bolt.spec, bolt.solid, bolt.seat)
    ]
    pieces = _with_distractors(spec, layout, _raw_pieces(spec, layout, lugs))
    pieces = [replace(piece, shape=settled(piece.shape)) for piece in pieces]
    clearance = settled(union([bolt.place(bolt_clearance(bolt.spec)) for bolt in bolts]))
    terminals = build_terminals(spec, layout)
    gear = _gear(spec, layout)
    obstacles = [(part.name, manifold_of(part)) for part in terminals]
    obstacles.append((gear.name, gear.shape))
    for bolt in bolts:
        check_seat(bolt, obstacles, pieces)
    shift = layout.motor_from_build
    parts = [solid_part(gear.shape, gear.name, gear.part, gear.material), *terminals]
    parts += _carve(pieces, [clearance, *(body for _, body in obstacles)])
    present = _name_bolts([bolt for bolt in bolts if bolt.spec.state == "present"])
    for name, bolt in present:
        material = Material.RUST if bolt.spec.rusty else Material.ZINC
        head, rod = split_bolt(bolt.solid)
        parts.append(
            solid_part(bolt.place(head), f"bolt_{name}", Part.BOLT, material, bolt_id=name)
        )
        if rod is not None:
            parts.append(solid_part(bolt.place(rod), rod_name(name), Part.MAIN_HOUSING, material))
    return MotorModel(
        spec=spec,
        parts=tuple(part.moved(shift) for part in parts),
        bolts=tuple(
            TrueBolt(
                id=name,
                spec=bolt.spec,
                side=Side.TOP if bolt.seat.outward[2] > 0 else Side.BOTTOM,
                motor_from_bolt=shift @ bolt.build_from_bolt,
                across_mm=bolt.solid.across_mm,
                head_diameter_mm=bolt.solid.head_diameter_mm,
                head_height_mm=bolt.solid.head_height_mm,
            )
            for name, bolt in present
        ),
    )


def _place_bolt(spec: MotorSpec, layout: Layout, index: int) -> PlacedBolt:
    bolt = spec.bolts[index]
    if bolt.site.value == "yoke":
        raise BoltPlaceError(index, "site yoke is for distractors, bolts are parallel to the axis")
    if bolt.site.value.startswith("solenoid") and spec.solenoid is None:
        raise BoltPlaceError(index, f"site {bolt.site.value} on a motor without solenoid")
    solid = build_bolt(bolt)
    seat = find_seat(
        spec,
        layout,
        bolt,
        head_radius_mm=solid.head_diameter_mm / 2,
        recess_mm=bolt.recess_mm,
    )
    top = np.asarray(seat.centre_mm) + solid.head_height_mm * np.asarray(seat.outward)
    rotation = np.eye(3) if seat.outward[2] > 0 else _TURNED_OVER
    return PlacedBolt(
        spec=bolt,
        index=index,
        solid=solid,
        seat=seat,
        build_from_bolt=Transform.from_parts("build", "bolt", rotation, top),
    )


def _raw_pieces(spec: MotorSpec, layout: Layout, lugs: Sequence[Lug]) -> list[Piece]:
    """All bodies but bolts, gear and terminals, in order of who keeps contested room."""
    return [
        *build_solenoid(spec, layout, lugs),
        *build_yoke(spec, layout, lugs),
        *build_rear_cap(spec, layout, lugs),
        *build_gearbox(spec, layout, lugs),
        *build_bracket(spec, layout, lugs),
    ]


def _with_distractors(spec: MotorSpec, layout: Layout, pieces: list[Piece]) -> list[Piece]:
    """Put distractors on the bodies that carry them."""
    for distractor in spec.distractors:
        seat = find_seat(spec, layout, distractor, head_radius_mm=distractor.size_mm / 2)
        solid = build_distractor(distractor)
        build_from_seat = _seat_pose(seat).matrix[:3]
        for index, piece in enumerate(pieces):
            if piece.body is not seat.body:
                continue
            shape = piece.shape
            if solid.cut is not None:
                shape = shape - solid.cut.transform(build_from_seat)
            if solid.add is not None:
                shape = shape + solid.add.transform(build_from_seat)
            pieces[index] = replace(piece, shape=shape)
    return pieces


def _seat_pose(seat: Seat) -> Transform:
    """Frame of a seat: +z out of the surface."""
    out = np.asarray(seat.outward)
    side = np.array([0.0, 0.0, 1.0]) if abs(out[2]) < 0.5 else np.array([1.0, 0.0, 0.0])
    rotation: FloatArray = np.column_stack([side, np.cross(out, side), out])
    return Transform.from_parts("build", "seat", rotation, np.asarray(seat.centre_mm))


def _gear(spec: MotorSpec, layout: Layout) -> Piece:
    floor = cavity_floor_z(spec, layout) - layout.flange_front_z
    solid: GearSolid = build_gear(
        spec.gear,
        shaft_front_mm=layout.shaft_tip_z - layout.flange_front_z,
        shaft_rear_mm=floor,
        turn_deg=spec.gear.turn_deg,
    )
    body = settled(solid.body.translate((*layout.shaft_xy, layout.flange_front_z)))
    return Piece(name="gear_pinion", part=Part.GEAR, material=Material.BARE_STEEL, shape=body)


def _carve(pieces: Sequence[Piece], obstacles: Sequence[Manifold]) -> list[SolidPart]:
    """Make pieces disjoint from what keeps its room and, by their order, from each other."""
    taken = list(obstacles)
    parts: list[SolidPart] = []
    for piece in pieces:
        shape = piece.shape - union([body for body in taken if boxes_touch(body, piece.shape)])
        shape = largest_piece(shape) if piece.in_one_piece else _without_crumbs(shape)
        if shape.is_empty():
            raise ConfigError(f"{piece.name}: other parts leave nothing of it")
        parts.append(solid_part(shape, piece.name, piece.part, piece.material))
        taken.append(shape)
    return parts


def _without_crumbs(shape: Manifold) -> Manifold:
    pieces = shape.decompose()
    if len(pieces) < 2:
        return shape
    return Manifold.compose([piece for piece in pieces if piece.volume() > _CRUMB_MM3])


def _name_bolts(bolts: Sequence[PlacedBolt]) -> list[tuple[str, PlacedBolt]]:
    """Give ids by side and angle; own ids of the specification stay."""

    def order(bolt: PlacedBolt) -> tuple[bool, float, float]:
        x, y, _ = bolt.seat.centre_mm
        angle = math.degrees(math.atan2(y, x)) % 360
        return bolt.seat.outward[2] < 0, round(angle, 6), math.hypot(x, y)

    named: list[tuple[str, PlacedBolt]] = []
    counts = {"T": 0, "B": 0}
    own = {bolt.spec.id for bolt in bolts if bolt.spec.id is not None}
    for bolt in sorted(bolts, key=order):
        letter = "T" if bolt.seat.outward[2] > 0 else "B"
        name = bolt.spec.id
        while name is None or (bolt.spec.id is None and name in own):
            counts[letter] += 1
            name = f"{letter}{counts[letter]}"
        named.append((name, bolt))
    return named
