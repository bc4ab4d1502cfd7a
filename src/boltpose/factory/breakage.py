"""Single marks of use: chips broken off edges, dents, lumps of grease."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.factory.model import Material, SolidPart, TrueBolt
from boltpose.factory.relief import face_normals, make_field
from boltpose.factory.solids import Manifold, manifold_of, mesh_arrays, solid_part, union
from boltpose.schema import Part

_BOLT_DISTANCE_MM = 4
"""Between a mark and the rim of a bolt's head."""
_CHIP_CORNERS = 14
_CHIP_OFFSET = 0.12
"""Middle of what breaks off, outside of the edge, in sizes of the chip."""
_TRIES = 12
_HOSTS_OF_GREASE = {Part.GEAR: 3.0, Part.CONNECTOR: 1.0, Part.MAIN_HOUSING: 0.3, Part.SOLENOID: 0.2}
"""How often grease sits on a class, per mm2."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Dent:
    """A smooth push into sheet metal."""

    centre: FloatArray
    """Shape (3,), mm."""
    direction: FloatArray
    """Shape (3,), unit, into the metal."""
    radius_mm: float
    depth_mm: float

    def displacement(self, vertices: FloatArray, normals: FloatArray) -> FloatArray:
        """How far vertices, shape (V, 3), move, shape (V, 3); those facing away do not."""
        away = vertices - self.centre
        squared = (away * away).sum(axis=1) / self.radius_mm**2
        facing = np.clip(-(normals * self.direction).sum(axis=1) * 4 - 0.4, 0, 1)
        depth = self.depth_mm * np.clip(1 - squared, 0, None) ** 2 * facing
        return depth[:, None] * self.direction


def make_dents(
    solids: Sequence[SolidPart],
    bolts: Sequence[TrueBolt],
    count: int,
    depth_mm: float,
    radius_mm: float,
    rng: np.random.Generator,
) -> tuple[Dent, ...]:
    """Draw dents on the outside of yoke and solenoid, away from bolts."""
    hosts = [solid for solid in solids if solid.part in (Part.MAIN_HOUSING, Part.SOLENOID)]
    dents: list[Dent] = []
    for _ in range(count if hosts else 0):
        radius, depth = radius_mm * rng.uniform(0.5, 1), depth_mm * rng.uniform(0.3, 1)
        spot = _outer_spot(hosts, bolts, radius, rng)
        if spot is not None:
            _, centre, normal = spot
            dents.append(Dent(centre=centre, direction=-normal, radius_mm=radius, depth_mm=depth))
    return tuple(dents)


def chip_edges(
    solids: Sequence[SolidPart],
    bolts: Sequence[TrueBolt],
    count: int,
    size_mm: float,
    rng: np.random.Generator,
) -> tuple[SolidPart, ...]:
    """Break pieces off sharp outer edges of the castings (class connector), away from bolts."""
    hosts = [index for index, solid in enumerate(solids) if solid.part is Part.CONNECTOR]
    result = list(solids)
    if not hosts or count == 0:
        return tuple(result)
    edges = [_sharp_edges(solids[index]) for index in hosts]
    chances = [edge.chances() for edge in edges]
    totals = np.array([float(chance.sum()) for chance in chances])
    if totals.sum() <= 0:
        return tuple(result)
    chips: dict[int, list[Manifold]] = {}
    for _ in range(count):
        size = size_mm * rng.uniform(0.4, 1)
        for _ in range(_TRIES):
            which = int(rng.choice(len(hosts), p=totals / totals.sum()))
            row = int(rng.choice(len(chances[which]), p=chances[which] / totals[which]))
            share = rng.random()
            start, end = edges[which].starts[row], edges[which].ends[row]
            centre = start + share * (end - start) + _CHIP_OFFSET * size * edges[which].outward[row]
            if _is_free(centre, bolts, size):
                chips.setdefault(hosts[which], []).append(_rubble(centre, size, rng))
                break
    for index, bodies in chips.items():
        body = manifold_of(solids[index]) - union(bodies)
        vertices, faces = mesh_arrays(body)
        if len(faces):
            result[index] = replace(solids[index], vertices=vertices, faces=faces)
    return tuple(result)


def make_grease(
    solids: Sequence[SolidPart],
    bolts: Sequence[TrueBolt],
    count: int,
    radius_mm: float,
    rng: np.random.Generator,
) -> tuple[SolidPart, ...]:
    """Draw lumps of grease; each is a part of its own with the class of what it sits on."""
    lumps: list[SolidPart] = []
    for number in range(1, count + 1):
        radius = radius_mm * rng.uniform(0.4, 1)
        spot = _outer_spot(solids, bolts, radius, rng, weights=_HOSTS_OF_GREASE)
        if spot is None:
            continue
        host, centre, normal = spot
        body = union([_lump(centre, normal, radius, rng) for _ in range(int(rng.integers(1, 4)))])
        name = f"{host.part.name.lower()}_grease_{number}"
        lumps.append(solid_part(body, name, host.part, Material.GREASE))
    return tuple(lumps)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Edges:
    """Sharp convex edges; all arrays of shape (E, 3)."""

    starts: FloatArray
    ends: FloatArray
    outward: FloatArray

    def chances(self) -> FloatArray:
        """How likely each is hit, shape (E,): long edges far out are."""
        middle = 0.5 * (self.starts + self.ends)
        length = np.linalg.norm(self.ends - self.starts, axis=1)
        return length * (middle[:, 0] ** 2 + middle[:, 1] ** 2)


def _sharp_edges(solid: SolidPart) -> _Edges:
    faces, vertices = solid.faces, solid.vertices
    normals = face_normals(vertices, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    opposite = faces[:, [2, 0, 1]].reshape(-1)
    owner = np.repeat(np.arange(len(faces)), 3)
    low, high = directed.min(axis=1), directed.max(axis=1)
    order = np.lexsort((high, low))
    pairs = order[: len(order) // 2 * 2].reshape(-1, 2)
    first, second = pairs[:, 0], pairs[:, 1]
    a, b = owner[first], owner[second]
    start, end = vertices[low[first]], vertices[high[first]]
    bend = (normals[a] * normals[b]).sum(axis=1)
    below = ((vertices[opposite[second]] - start) * normals[a]).sum(axis=1)
    outward = normals[a] + normals[b]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    middle = 0.5 * (start + end)
    # edges that look at the motor's axis are inside
    looks_out = (outward[:, :2] * middle[:, :2]).sum(axis=1) > 0
    keep: BoolArray = (bend > -0.5) & (bend < 0.9) & (below < -1e-6) & looks_out
    return _Edges(starts=start[keep], ends=end[keep], outward=outward[keep])


def _rubble(centre: FloatArray, size_mm: float, rng: np.random.Generator) -> Manifold:
    """An irregular convex piece around a point."""
    directions = rng.normal(size=(_CHIP_CORNERS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = size_mm * rng.uniform(0.75, 1.05, size=(_CHIP_CORNERS, 1))
    return Manifold.hull_points(centre + radii * directions)


def _lump(
    centre: FloatArray, normal: FloatArray, radius_mm: float, rng: np.random.Generator
) -> Manifold:
    """A flat rounded lump on a surface, half of it below."""
    sphere = Manifold.sphere(1.0, 24)
    vertices, faces = mesh_arrays(sphere)
    field = make_field(1.6, rng)
    vertices = vertices * (1 + 0.18 * field.at(vertices))
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    side = np.cross(normal, helper)
    side /= np.linalg.norm(side)
    other = np.cross(normal, side)
    wide, narrow = rng.uniform(0.8, 1), rng.uniform(0.5, 0.9)
    shift = 0.5 * rng.uniform(-1, 1, size=2)
    thick = rng.uniform(0.2, 0.45)
    placed = centre + radius_mm * (
        (wide * vertices[:, :1] + shift[0]) * side
        + (narrow * vertices[:, 1:2] + shift[1]) * other
        + thick * vertices[:, 2:] * normal
    )
    mirrored = float(np.dot(np.cross(side, other), normal)) < 0
    faces = faces[:, ::-1] if mirrored else faces
    return manifold_of(
        SolidPart(
            name="lump",
            part=Part.BACKGROUND,
            material=Material.GREASE,
            vertices=placed,
            faces=np.ascontiguousarray(faces),
        )
    )


def _outer_spot(
    hosts: Sequence[SolidPart],
    bolts: Sequence[TrueBolt],
    radius_mm: float,
    rng: np.random.Generator,
    *,
    weights: dict[Part, float] | None = None,
) -> tuple[SolidPart, FloatArray, FloatArray] | None:
    """A random point on the outside: host, point, normal; None if none was found."""
    areas: list[FloatArray] = []
    for solid in hosts:
        weight = 1.0 if weights is None else weights.get(solid.part, 0.0)
        normals = face_normals(solid.vertices, solid.faces)
        centres = solid.vertices[solid.faces].mean(axis=1)
        # a hull of the part's cross-section: points that look away from its middle line
        away = centres[:, :2] - 0.5 * (
            solid.vertices[:, :2].min(axis=0) + solid.vertices[:, :2].max(axis=0)
        )
        outward = (normals[:, :2] * away).sum(axis=1)
        size = np.linalg.norm(normals, axis=1)
        looks_out = outward > 0.6 * size * np.linalg.norm(away, axis=1)
        areas.append(np.where(looks_out, 0.5 * weight * size, 0.0))
    totals = np.concatenate(areas) if areas else np.zeros(0)
    if totals.sum() <= 0:
        return None
    owners: IntArray = np.repeat(np.arange(len(hosts)), [len(a) for a in areas])
    firsts = np.cumsum([0, *[len(a) for a in areas]])
    cumulated = np.cumsum(totals)
    for _ in range(_TRIES):
        index = int(np.searchsorted(cumulated, rng.random() * cumulated[-1], side="right"))
        host = hosts[int(owners[index])]
        corner = host.vertices[host.faces[index - int(firsts[owners[index]])]]
        shares = rng.dirichlet((1, 1, 1))
        point = shares @ corner
        if _is_free(point, bolts, radius_mm):
            normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
            return host, point, normal / np.linalg.norm(normal)
    return None


def _is_free(point: FloatArray, bolts: Sequence[TrueBolt], radius_mm: float) -> bool:
    """True if no bolt's axis is near."""
    for bolt in bolts:
        beside = np.linalg.norm(np.cross(point - bolt.head_top, bolt.axis))
        if beside < 0.5 * bolt.head_diameter_mm + _BOLT_DISTANCE_MM + radius_mm:
            return False
    return True
