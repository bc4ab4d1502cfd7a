"""What use does to a motor: warp, rust, dirt, dents, chips, grease, clogged drives.

Every part stays closed, and no bolt's axis moves: bolts get relief along their normals alone,
and what lies around a bolt keeps away from it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray, IntArray
from boltpose.factory.bolts import build_bolt, split_bolt
from boltpose.factory.breakage import Dent, chip_edges, make_dents, make_grease
from boltpose.factory.model import Material, MotorModel, SolidPart, TrueBolt
from boltpose.factory.relief import Field, face_normals, make_field, patches, vertex_normals
from boltpose.factory.solids import manifold_of, mesh_arrays
from boltpose.factory.spec_fasteners import HeadKind
from boltpose.factory.wear_spec import WearSpec
from boltpose.schema import Part

_BOLT_EDGE_SHARE = 0.67
"""Bolts are small: their edges are so much shorter."""
_TRIANGLES = 430_000
"""About as many as the refined solids get at most; large motors get longer edges."""
_TRIANGLES_PER_SQUARE = 7.5
"""Of the longest edge; measured on 16 motors, slivers of the booleans included."""
_KEEP_OFF_MM = (0.6, 3.6)
"""Beside a bolt's head relief grows from nothing to full between these distances."""
_RELIEF_FLOOR = 0.35
"""Share of the crust that lies everywhere in a patch; the rest follows its relief."""
_SOFT = (Material.RUBBER, Material.STRAP, Material.GREASE)
"""Does not rust."""
_RUSTS = (
    Material.PAINTED_STEEL,
    Material.BARE_STEEL,
    Material.ZINC,
    Material.CAST_IRON,
    Material.RUST,
)
_OXIDE_SHARE = 0.35
"""How much of the rust's thickness the oxide of aluminium and copper has."""


def wear_motor(model: MotorModel, wear: WearSpec, seed: int) -> MotorModel:
    """Age a motor.

    Args:
        model: As it was built.
        wear: What happened to it.
        seed: Where it happened. The same model, wear and seed give the same bits.

    Returns:
        The motor with finer meshes; parts keep their names and order, grease comes last. Poses
        and specifications of the bolts stay as they are.
    """
    chips, grease, clogs = np.random.default_rng(seed).integers(0, 2**63, size=3).tolist()
    parts = _clog_drives(model, wear, np.random.default_rng(clogs))
    parts = chip_edges(parts, model.bolts, wear.chips, wear.chip_mm, np.random.default_rng(chips))
    lumps = make_grease(
        parts, model.bolts, wear.grease, wear.grease_mm, np.random.default_rng(grease)
    )
    worn = wear_solids(parts, wear, seed, bolts=model.bolts)
    return replace(model, parts=(*worn, *lumps))


def wear_solids(
    solids: Sequence[SolidPart], wear: WearSpec, seed: int, *, bolts: Sequence[TrueBolt] = ()
) -> tuple[SolidPart, ...]:
    """Lay warp, roughness, rust, dirt and dents on solids; clamps too.

    Neighbouring parts share the fields, so that joints do not open: warp moves all of them
    alike, rust and dirt only grow outwards.

    Args:
        solids: All in one frame.
        wear: How much of what.
        seed: Where.
        bolts: Whose surroundings stay clear; in the frame of the solids.

    Returns:
        As many solids, in order, with edges no longer than `wear.edge_mm`, on large motors
        longer.
    """
    streams = np.random.default_rng(seed).spawn(8)
    fields = _Fields(
        warp=make_field(wear.warp_wavelength_mm, streams[0], channels=3),
        roughness=make_field(wear.roughness_wavelength_mm, streams[1]),
        rust_patch=make_field(wear.rust_patch_mm, streams[2]),
        rust=make_field(wear.rust_wavelength_mm, streams[3]),
        dirt_patch=make_field(wear.dirt_patch_mm, streams[4]),
        dirt=make_field(max(4.0, 0.35 * wear.dirt_patch_mm), streams[5]),
    )
    dents = make_dents(solids, bolts, wear.dents, wear.dent_mm, wear.dent_radius_mm, streams[6])
    by_id = {bolt.id: bolt for bolt in bolts}
    edge_mm = _edge_length_mm(solids, wear)
    return tuple(
        _wear_bolt(solid, by_id.get(solid.bolt_id or ""), wear, fields, edge_mm)
        if solid.part is Part.BOLT
        else _wear_body(solid, wear, fields, dents, bolts, edge_mm)
        for solid in solids
    )


def _edge_length_mm(solids: Sequence[SolidPart], wear: WearSpec) -> float:
    """Longest edge of the refined meshes: as specified, or longer on a large motor."""
    area_mm2 = 0.0
    for solid in solids:
        doubled = face_normals(solid.vertices, solid.faces)
        area_mm2 += 0.5 * float(np.sqrt((doubled * doubled).sum(axis=1)).sum())
    return max(wear.edge_mm, math.sqrt(_TRIANGLES_PER_SQUARE * area_mm2 / _TRIANGLES))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Fields:
    warp: Field
    roughness: Field
    rust_patch: Field
    rust: Field
    dirt_patch: Field
    dirt: Field


def refine(solid: SolidPart, edge_mm: float) -> tuple[FloatArray, IntArray]:
    """Vertices and faces of the same surface with no edge longer than `edge_mm`."""
    return mesh_arrays(manifold_of(solid).refine_to_length(edge_mm))


def _wear_body(
    solid: SolidPart,
    wear: WearSpec,
    fields: _Fields,
    dents: Sequence[Dent],
    bolts: Sequence[TrueBolt],
    edge_mm: float,
) -> SolidPart:
    vertices, faces = refine(solid, edge_mm)
    normals = vertex_normals(vertices, faces)
    height = wear.roughness_mm * fields.roughness.at(vertices)[:, 0]
    if solid.material not in _SOFT:
        share = 1.0 if solid.material in _RUSTS else _OXIDE_SHARE
        height += share * _rust(vertices, wear, fields)
    height += _dirt(vertices, wear, fields)
    moves = (height * _distance_share(vertices, bolts))[:, None] * normals
    moves += wear.warp_mm * fields.warp.at(vertices)
    moves += _deepest(dents, vertices, normals)
    return replace(solid, vertices=vertices + moves, faces=faces)


def _deepest(dents: Sequence[Dent], vertices: FloatArray, normals: FloatArray) -> FloatArray:
    """Displacement by dents, shape (V, 3); where they overlap the deeper one counts."""
    moves = np.zeros_like(vertices)
    for dent in dents:
        own = dent.displacement(vertices, normals)
        is_deeper = (own * own).sum(axis=1) > (moves * moves).sum(axis=1)
        moves[is_deeper] = own[is_deeper]
    return moves


def _wear_bolt(
    solid: SolidPart, bolt: TrueBolt | None, wear: WearSpec, fields: _Fields, edge_mm: float
) -> SolidPart:
    vertices, faces = refine(solid, _BOLT_EDGE_SHARE * edge_mm)
    if bolt is not None and wear.corner_wear > 0:
        vertices = _round_corners(vertices, bolt, wear.corner_wear)
    normals = vertex_normals(vertices, faces)
    rusty = solid.material is Material.RUST or (bolt is not None and bolt.spec.rusty)
    height = wear.bolt_share * wear.roughness_mm * fields.roughness.at(vertices)[:, 0]
    if rusty:
        relief = 0.5 + 0.5 * fields.rust.at(vertices)[:, 0]
        height += wear.rust_mm * (_RELIEF_FLOOR + (1 - _RELIEF_FLOOR) * relief)
    else:
        height += wear.bolt_share * _rust(vertices, wear, fields)
    return replace(solid, vertices=vertices + height[:, None] * normals, faces=faces)


def _rust(vertices: FloatArray, wear: WearSpec, fields: _Fields) -> FloatArray:
    """Thickness of the crust, shape (V,)."""
    if wear.rust_mm == 0 or wear.rust_share == 0:
        return np.zeros(len(vertices))
    mask = patches(fields.rust_patch, vertices, wear.rust_share)
    relief = 0.5 + 0.5 * fields.rust.at(vertices)[:, 0]
    return wear.rust_mm * mask * (_RELIEF_FLOOR + (1 - _RELIEF_FLOOR) * relief)


def _dirt(vertices: FloatArray, wear: WearSpec, fields: _Fields) -> FloatArray:
    """Thickness of caked dirt, shape (V,)."""
    if wear.dirt_mm == 0 or wear.dirt_share == 0:
        return np.zeros(len(vertices))
    mask = patches(fields.dirt_patch, vertices, wear.dirt_share, softness=0.4)
    relief = 0.5 + 0.5 * fields.dirt.at(vertices)[:, 0]
    return wear.dirt_mm * mask * relief


def _distance_share(vertices: FloatArray, bolts: Sequence[TrueBolt]) -> FloatArray:
    """Shape (V,): 0 at a bolt's head and along its shank, 1 where no bolt is near."""
    share = np.ones(len(vertices))
    for bolt in bolts:
        away = vertices - bolt.head_top
        x, y, z = bolt.axis
        along = away[:, 0] * x + away[:, 1] * y + away[:, 2] * z
        squared = (away * away).sum(axis=1) - along * along
        beside = np.sqrt(np.maximum(squared, 0)) - 0.5 * bolt.head_diameter_mm
        over = np.maximum(along - 3, 0)  # what is far above a head is free to be dirty
        low, high = _KEEP_OFF_MM
        ramp = np.clip((np.maximum(beside, over) - low) / (high - low), 0, 1)
        np.minimum(share, ramp, out=share)
    return share


def _round_corners(vertices: FloatArray, bolt: TrueBolt, amount: float) -> FloatArray:
    """Pull the corners of a hexagon in towards the circle of its flats."""
    if bolt.spec.head not in (HeadKind.HEX, HeadKind.HEX_FLANGE):
        return vertices
    local = bolt.motor_from_bolt.inverse().apply(vertices)
    flats = 0.5 * bolt.across_mm
    radius = np.hypot(local[:, 0], local[:, 1])
    corner = flats / np.cos(np.pi / 6)
    limit = corner - amount * (corner - flats)
    # a flange lies further out than any corner; what is above it is the hexagon
    is_hexagon = (
        (radius > limit) & (radius < corner + 0.05) & (local[:, 2] > -0.55 * bolt.head_height_mm)
    )
    shrink = np.where(is_hexagon, limit / np.maximum(radius, 1e-9), 1.0)
    rounded = local.copy()
    rounded[:, :2] *= shrink[:, None]
    return np.where(is_hexagon[:, None], bolt.motor_from_bolt.apply(rounded), vertices)


def _clog_drives(
    model: MotorModel, wear: WearSpec, rng: np.random.Generator
) -> tuple[SolidPart, ...]:
    """Fill some drives with dirt, on top of what their specification says."""
    by_id = {bolt.id: bolt for bolt in model.bolts}
    parts: list[SolidPart] = []
    for solid in model.parts:
        bolt = by_id.get(solid.bolt_id or "")
        if bolt is None:
            parts.append(solid)
            continue
        hit, amount = rng.random() < wear.clogged_share, wear.clogged * rng.uniform(0.4, 1)
        if not hit or amount <= bolt.spec.clogged:
            parts.append(solid)
            continue
        clogged = bolt.spec.model_copy(update={"clogged": float(amount)})
        head, _ = split_bolt(build_bolt(clogged))
        vertices, faces = mesh_arrays(head)
        moved = bolt.motor_from_bolt.apply(vertices)
        parts.append(replace(solid, vertices=moved, faces=faces))
    return tuple(parts)
