"""Constructive solid geometry: the primitives that motors and clamps are made of (manifold3d).

All functions are pure; angles are degrees, lengths mm; round things are faceted finely enough
that no facet is more than `FACET_SAGITTA_MM` off the true surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import MissingExtraError
from boltpose.factory.model import Material, SolidPart
from boltpose.schema import Part

try:
    from manifold3d import CrossSection, Manifold, Mesh64, OpType
except ImportError as error:  # pragma: no cover
    raise MissingExtraError("manifold3d", "synth") from error

FACET_SAGITTA_MM = 0.02
"""Below the noise of any scanner modelled here."""


def segments(radius_mm: float) -> int:
    """How many facets a circle needs, a multiple of 4."""
    if radius_mm <= FACET_SAGITTA_MM:
        return 8
    step = 2 * math.acos(1 - FACET_SAGITTA_MM / radius_mm)
    return int(np.clip(4 * math.ceil(2 * math.pi / step / 4), 12, 160))


def cylinder(
    radius_mm: float, z_low_mm: float, z_high_mm: float, *, top_radius_mm: float | None = None
) -> Manifold:
    """A cylinder or truncated cone about the z axis."""
    top = radius_mm if top_radius_mm is None else top_radius_mm
    body = Manifold.cylinder(z_high_mm - z_low_mm, radius_mm, top, segments(max(radius_mm, top)))
    return body.translate((0, 0, z_low_mm))


def tube(outer_mm: float, inner_mm: float, z_low_mm: float, z_high_mm: float) -> Manifold:
    """A hollow cylinder about the z axis."""
    hole = cylinder(inner_mm, z_low_mm - 1, z_high_mm + 1)
    return cylinder(outer_mm, z_low_mm, z_high_mm) - hole


def turned(profile_mm: Sequence[tuple[float, float]]) -> Manifold:
    """Revolve a closed profile of (radius, z) pairs, counter-clockwise, about the z axis."""
    section = CrossSection([np.asarray(profile_mm, dtype=np.float64)])
    return section.revolve(segments(max(radius for radius, _ in profile_mm)))


def box(size_mm: Sequence[float], centre_mm: Sequence[float] = (0, 0, 0)) -> Manifold:
    """A block with edges along the axes."""
    return Manifold.cube(list(size_mm), True).translate(list(centre_mm))


def prism(polygon_mm: npt.ArrayLike, z_low_mm: float, z_high_mm: float) -> Manifold:
    """Extrude a counter-clockwise polygon of shape (K, 2) along z."""
    section = CrossSection([np.asarray(polygon_mm, dtype=np.float64)])
    return section.extrude(z_high_mm - z_low_mm).translate((0, 0, z_low_mm))


def regular_polygon(sides: int, across_mm: float, roll_deg: float = 0) -> FloatArray:
    """Corners, shape (sides, 2), of an even-sided polygon by the distance of opposite sides."""
    radius = across_mm / 2 / math.cos(math.pi / sides)
    angles = np.radians(roll_deg) + 2 * math.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def polar(radius_mm: float, angle_deg: float) -> tuple[float, float]:
    """Polar to x and y."""
    angle = math.radians(angle_deg)
    return radius_mm * math.cos(angle), radius_mm * math.sin(angle)


def union(bodies: Sequence[Manifold]) -> Manifold:
    """All bodies as one; empty for none."""
    return Manifold.batch_boolean(list(bodies), OpType.Add) if bodies else Manifold()


def hull(bodies: Sequence[Manifold]) -> Manifold:
    """The convex hull of several bodies."""
    return Manifold.batch_hull(list(bodies))


def settled(body: Manifold) -> Manifold:
    """Work a body's booleans out once; left lazy, each use would work them out anew."""
    body.num_tri()
    return body


def boxes_touch(first: Manifold, second: Manifold) -> bool:
    """Whether the boxes around two bodies meet; never with an empty body."""
    if first.is_empty() or second.is_empty():
        return False
    a, b = np.asarray(first.bounding_box()), np.asarray(second.bounding_box())
    return bool((a[:3] < b[3:]).all() and (b[:3] < a[3:]).all())


def solid_part(
    body: Manifold, name: str, part: Part, material: Material, *, bolt_id: str | None = None
) -> SolidPart:
    """Freeze a body into a record.

    Raises:
        ValueError: The body is empty.
    """
    if body.is_empty():
        raise ValueError(f"{name} is empty")
    vertices, faces = mesh_arrays(body)
    return SolidPart(
        name=name, part=part, material=material, vertices=vertices, faces=faces, bolt_id=bolt_id
    )


def mesh_arrays(body: Manifold) -> tuple[FloatArray, IntArray]:
    """Vertices of shape (V, 3) in mm and faces of shape (F, 3); the mesh is closed."""
    mesh = body.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    return np.ascontiguousarray(vertices), np.asarray(mesh.tri_verts, dtype=np.int64)


def manifold_of(solid: SolidPart) -> Manifold:
    """The record as a body again, for booleans and distances."""
    return Manifold(
        Mesh64(
            vert_properties=solid.vertices.copy(),
            tri_verts=solid.faces.astype(np.uint64),
        )
    )
