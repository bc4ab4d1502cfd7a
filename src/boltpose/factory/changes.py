"""What happens to a motor between its full scan and its place in the clamp."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.factory.bolts import build_bolt, head_size, rod_name, split_bolt
from boltpose.factory.breakage import make_grease
from boltpose.factory.cables import find_obstacles, obstacle_distance
from boltpose.factory.layout import Layout, lay_out
from boltpose.factory.model import Material, MotorModel, SolidPart, TrueBolt
from boltpose.factory.solids import manifold_of, mesh_arrays, solid_part
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind
from boltpose.factory.terminals import build_terminals
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part

_PREFIX = "electrical_connector_"
_STUMP_SHARE = 0.25
"""Of a plug that broke off."""
_HEAD_PLAY_MM = 0.3
"""A replaced bolt may be so much wider than the one before; it still fits its counterbore."""
_FRESH_GREASE_MM = 6.0
_PUSHES = 12


class ChangeKind(StrEnum):
    """One kind of change."""

    CABLE_ASIDE = "cable_aside"
    CABLE_GONE = "cable_gone"
    PLUG_BROKEN = "plug_broken"
    NUT_GONE = "nut_gone"
    FRESH_GREASE = "fresh_grease"
    BOLT_LOST = "bolt_lost"
    BOLT_REPLACED = "bolt_replaced"


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One change, as it is recorded."""

    kind: ChangeKind
    subject: str
    """Name of the part it happened to."""
    bolt_id: str | None = None
    """Which bolt of the full scan was lost or replaced."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeRates:
    """How likely every change is, 0 to 1."""

    cable_aside: float = 0.6
    cable_gone: float = 0.05
    plug_broken: float = 0.08
    nut_gone: float = 0.06
    """Per stud."""
    fresh_grease: float = 0.15
    bolt_lost: float = 0.012
    """Per bolt."""
    bolt_replaced: float = 0.015
    """Per bolt; by another head of the same thread."""
    push_mm: float = 7.0
    """How far a cable is pushed aside at most."""

    def __post_init__(self) -> None:
        for name in (kind.value for kind in ChangeKind):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise ConfigError(f"{name} must be 0 to 1, got {value}")
        if not 0 < self.push_mm <= 30:
            raise ConfigError(f"push_mm must be above 0 and at most 30, got {self.push_mm}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ChangedMotor:
    """A motor after its full scan, and what is different."""

    model: MotorModel
    changes: tuple[Change, ...]

    @property
    def lost(self) -> tuple[str, ...]:
        """Ids of bolts in the full scan that are no longer there."""
        return tuple(
            change.bolt_id
            for change in self.changes
            if change.kind is ChangeKind.BOLT_LOST and change.bolt_id is not None
        )


def change_motor(
    model: MotorModel, rng: np.random.Generator, rates: ChangeRates | None = None
) -> MotorModel:
    """Change a motor as `draw_changes` does, without the record."""
    return draw_changes(model, rng, rates).model


def draw_changes(
    model: MotorModel, rng: np.random.Generator, rates: ChangeRates | None = None
) -> ChangedMotor:
    """Change a motor by chance, as handling between scan and clamp does.

    Args:
        model: The motor as it was scanned, worn or not, in frame `motor`.
        rng: The source of randomness; every chance is drawn whether or not it applies, so that
            a change of one rate leaves the other changes as they were.
        rates: How likely every change is.

    Returns:
        The motor in the same frame. Bolts that stay keep ids and poses; a replaced bolt keeps
        its id and axis, its head has another shape and top. The model's `spec` stays as it was.
    """
    chance = rates or ChangeRates()
    layout = lay_out(model.spec)
    cable, plug, grease, *rest = rng.spawn(3 + len(model.spec.terminals.studs) + len(model.bolts))
    nuts = rest[: len(model.spec.terminals.studs)]
    bolt_rngs = rest[len(nuts) :]
    parts, changes = list(model.parts), list[Change]()
    parts = _change_cable(parts, model.spec, layout, chance, cable, changes)
    if plug.random() < chance.plug_broken:
        parts = _break_plug(parts, model.spec, layout, changes)
    for number, nut in enumerate(nuts, start=1):
        if nut.random() < chance.nut_gone:
            parts = _lose_nut(parts, model.spec, layout, number, changes)
    bolts: list[TrueBolt] = []
    for bolt, own in zip(model.bolts, bolt_rngs, strict=True):
        row = next((k for k, part in enumerate(parts) if part.bolt_id == bolt.id), None)
        luck = own.random()
        if row is None or luck >= chance.bolt_lost + chance.bolt_replaced:
            bolts.append(bolt)
        elif luck < chance.bolt_lost:
            lost = parts.pop(row)
            parts = [part for part in parts if part.name != rod_name(bolt.id)]
            changes.append(Change(kind=ChangeKind.BOLT_LOST, subject=lost.name, bolt_id=bolt.id))
        else:
            new = _replace_bolt(bolt, own)
            if new is None:
                bolts.append(bolt)
                continue
            parts[row], fresh = new
            bolts.append(fresh)
            changes.append(
                Change(kind=ChangeKind.BOLT_REPLACED, subject=parts[row].name, bolt_id=bolt.id)
            )
    if grease.random() < chance.fresh_grease:
        for lump in make_grease(parts, bolts, 1, _FRESH_GREASE_MM, grease):
            name = f"{lump.part.name.lower()}_fresh_grease"
            parts.append(replace(lump, name=name))
            changes.append(Change(kind=ChangeKind.FRESH_GREASE, subject=name))
    changed = replace(model, parts=tuple(parts), bolts=tuple(bolts))
    return ChangedMotor(model=changed, changes=tuple(changes))


def _named(parts: Sequence[SolidPart], name: str) -> int | None:
    """Row of a terminal's part."""
    return next((k for k, part in enumerate(parts) if part.name == _PREFIX + name), None)


def _change_cable(
    parts: list[SolidPart],
    spec: MotorSpec,
    layout: Layout,
    chance: ChangeRates,
    rng: np.random.Generator,
    changes: list[Change],
) -> list[SolidPart]:
    luck, amount = rng.random(), chance.push_mm * rng.uniform(0.25, 1)
    turn = rng.uniform(0, 2 * math.pi)
    row, lug, grommet = (_named(parts, name) for name in ("cable", "lug", "grommet"))
    if row is None or lug is None or grommet is None or spec.terminals.cable is None:
        return parts
    if luck < chance.cable_gone:
        # the grommet stays, with the hole that the cable went through; the nut moves up
        stud = _named(parts, f"stud_{spec.terminals.cable.stud + 1}")
        gone = spec.model_copy(
            update={"terminals": spec.terminals.model_copy(update={"cable": None})}
        )
        name = parts[row].name
        if stud is not None:
            parts[stud] = _rebuilt(parts[stud], gone, layout)
        changes.append(Change(kind=ChangeKind.CABLE_GONE, subject=name))
        return [part for k, part in enumerate(parts) if k not in (row, lug)]
    if luck < chance.cable_gone + chance.cable_aside:
        start, end = (
            0.5 * (p.vertices.min(0) + p.vertices.max(0)) for p in (parts[lug], parts[grommet])
        )
        pushed = _push_cable(parts[row], start, end, spec, layout, amount, turn)
        if pushed is not None:
            parts[row] = pushed
            changes.append(Change(kind=ChangeKind.CABLE_ASIDE, subject=pushed.name))
    return parts


def _push_cable(
    cable: SolidPart,
    start: FloatArray,
    end: FloatArray,
    spec: MotorSpec,
    layout: Layout,
    amount_mm: float,
    turn_rad: float,
) -> SolidPart | None:
    """Bend the middle of a cable to the side that has most room; None if none has."""
    from_start = np.linalg.norm(cable.vertices - start, axis=1)
    from_end = np.linalg.norm(cable.vertices - end, axis=1)
    share = from_start / np.maximum(from_start + from_end, 1e-9)
    bump = np.clip((share - 0.22) * (0.8 - share) / 0.0841, 0, None) ** 2
    line = (end - start) / np.linalg.norm(end - start)
    helper = np.eye(3)[int(np.argmin(np.abs(line)))]
    side = np.cross(line, helper)
    side /= np.linalg.norm(side)
    other = np.cross(line, side)
    motor_from_build = layout.motor_from_build.translation_mm
    obstacles = find_obstacles(spec, layout)

    def room(vertices: FloatArray) -> float:
        free = vertices[bump > 0.2] - motor_from_build
        if not len(free):
            return 0.0
        return min(float(obstacle_distance(free, obstacle).min()) for obstacle in obstacles)

    best: tuple[float, FloatArray] | None = None
    before = room(cable.vertices)
    for step in range(_PUSHES):
        angle = turn_rad + 2 * math.pi * step / _PUSHES
        direction = math.cos(angle) * side + math.sin(angle) * other
        moved = cable.vertices + (amount_mm * bump)[:, None] * direction
        space = room(moved)
        if space >= min(before, 0.5):
            best = (space, moved)
            break
    return None if best is None else replace(cable, vertices=best[1])


def _break_plug(
    parts: list[SolidPart], spec: MotorSpec, layout: Layout, changes: list[Change]
) -> list[SolidPart]:
    """Leave a stump of the plug."""
    row, contacts = _named(parts, "plug"), _named(parts, "plug_contacts")
    plug = spec.terminals.plug
    if row is None or plug is None:
        return parts
    if plug.on_side:
        angle = math.radians(plug.angle_deg)
        out = np.array([math.cos(angle), math.sin(angle), 0.0])
    else:
        out = np.array([0.0, 0.0, -1.0])
    tip = float((parts[row].vertices @ out).max())
    if plug.kind == "blade":  # its housing is the lower third
        tip += 0.65 * plug.size_mm[2]
    level = tip - (1 - _STUMP_SHARE) * plug.size_mm[2]
    stump = manifold_of(parts[row]).trim_by_plane(tuple((-out).tolist()), -level)
    changes.append(Change(kind=ChangeKind.PLUG_BROKEN, subject=parts[row].name))
    if not stump.is_empty():
        vertices, faces = mesh_arrays(stump)
        parts[row] = replace(parts[row], vertices=vertices, faces=faces)
    dropped = {contacts} if not stump.is_empty() else {contacts, row}
    return [part for k, part in enumerate(parts) if k not in dropped]


def _lose_nut(
    parts: list[SolidPart], spec: MotorSpec, layout: Layout, number: int, changes: list[Change]
) -> list[SolidPart]:
    stud = spec.terminals.studs[number - 1]
    row = _named(parts, f"stud_{number}")
    cable = spec.terminals.cable
    holds_cable = cable is not None and cable.stud == number - 1
    # of two nuts around a lug the outer one is lost with the cable, or not at all
    if row is None or stud.nuts == 0 or (stud.nuts == 2 and holds_cable):
        return parts
    studs = list(spec.terminals.studs)
    studs[number - 1] = stud.model_copy(update={"nuts": stud.nuts - 1})
    if cable is not None and _named(parts, "cable") is None:
        cable = None
    terminals = spec.terminals.model_copy(update={"studs": tuple(studs), "cable": cable})
    parts[row] = _rebuilt(parts[row], spec.model_copy(update={"terminals": terminals}), layout)
    changes.append(Change(kind=ChangeKind.NUT_GONE, subject=parts[row].name))
    return parts


def _rebuilt(part: SolidPart, spec: MotorSpec, layout: Layout) -> SolidPart:
    """The part of that name as another specification of the terminals has it."""
    for fresh in build_terminals(spec, layout):
        if fresh.name == part.name:
            return fresh.moved(layout.motor_from_build)
    return part


def _replace_bolt(bolt: TrueBolt, rng: np.random.Generator) -> tuple[SolidPart, TrueBolt] | None:
    """Another head on the same thread and seat; None if no other fits."""
    widest = bolt.head_diameter_mm + (_HEAD_PLAY_MM if bolt.spec.recess_mm > 0 else 1.5)
    choices: list[BoltSpec] = []
    for kind in HeadKind:
        spec = bolt.spec.model_copy(
            update={
                "head": kind,
                "across_mm": None,
                "head_height_mm": None,
                "dish_mm": 0.0,
                "clogged": 0.0,
                "rusty": False,
                "washer": False,
                "roll_deg": bolt.spec.roll_deg + 40,
            }
        )
        hexagon = kind in (HeadKind.HEX, HeadKind.HEX_FLANGE)
        size = head_size(spec)
        wide = max(size.flange_mm, size.across_mm / (math.cos(math.pi / 6) if hexagon else 1))
        if kind is not bolt.spec.head and wide <= widest:
            choices.append(spec)
    if not choices:
        return None
    spec = choices[int(rng.integers(len(choices)))]
    solid = build_bolt(spec)
    lift = solid.head_height_mm - bolt.head_height_mm
    bolt_from_new = Transform.from_parts("bolt", "new", np.eye(3), (0.0, 0.0, lift))
    moved = bolt.motor_from_bolt @ bolt_from_new
    pose = Transform("motor", "bolt", moved.matrix)
    head, _ = split_bolt(solid)  # a rod stays: another head on the same thread
    part = solid_part(head, f"bolt_{bolt.id}", Part.BOLT, Material.ZINC, bolt_id=bolt.id)
    return replace(part, vertices=pose.apply(part.vertices)), replace(
        bolt,
        spec=spec,
        motor_from_bolt=pose,
        across_mm=solid.across_mm,
        head_diameter_mm=solid.head_diameter_mm,
        head_height_mm=solid.head_height_mm,
    )
