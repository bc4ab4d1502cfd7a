"""Rays against solids: what a ray meets first, and whether anything stands between two points.

Embree works in single precision. Which triangle a ray meets is its answer; where, is computed
again from that triangle's plane in double precision, so that hits lie on the mesh to far below a
micrometre at any distance of the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray, UInt8Array
from boltpose.errors import MissingExtraError, ShapeError
from boltpose.factory.model import SolidPart

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except ImportError as error:  # pragma: no cover
    raise MissingExtraError("embreex", "synth") from error

SHADOW_GAP_MM = 0.02
"""An obstacle closer than this to a point does not shade it: it is the point's own surface, met
a little early in single precision."""

_FAR = np.float32(1e30)
_PARALLEL = 1e-9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Hits:
    """Where rays ended, one row per ray. Rows of rays that met nothing hold what is said below."""

    distance_mm: FloatArray
    """Shape (N,), along the ray; infinite for a miss."""
    face_index: IntArray
    """Shape (N,), row of `RayCaster.faces`; -1 for a miss."""
    solid_index: IntArray
    """Shape (N,), which solid; -1 for a miss."""
    points: FloatArray
    """Shape (N, 3), mm, frame of the solids, on the mesh; the ray's origin for a miss."""
    normals: FloatArray
    """Shape (N, 3), unit, out of the solid, of the flat triangle; zero for a miss."""

    @property
    def is_hit(self) -> BoolArray:
        """Shape (N,)."""
        return self.face_index >= 0


class RayCaster:
    """Solids made ready for rays.

    Args:
        solids: At least one, all in one frame; they may overlap.

    Attributes:
        solids: As given.
        faces: Shape (F, 3), int64, indices of `vertices`, of all solids one after the other.
        vertices: Shape (V, 3), mm.
        labels: Shape (S,), uint8, the class of each solid.
        centre_mm: Shape (3,), middle of the box around all solids.
        radius_mm: Of the ball around `centre_mm` that holds all solids.

    Raises:
        ShapeError: There are no solids or no triangles.
    """

    def __init__(self, solids: Sequence[SolidPart]) -> None:
        if not any(len(solid.faces) for solid in solids):
            raise ShapeError("rays need at least one solid with triangles, got none")
        self.solids: tuple[SolidPart, ...] = tuple(solids)
        starts = np.cumsum([0] + [len(solid.vertices) for solid in solids])
        self.vertices: FloatArray = np.concatenate([solid.vertices for solid in solids])
        self.faces: IntArray = np.concatenate(
            [solid.faces + start for solid, start in zip(solids, starts, strict=False)]
        )
        self.labels: UInt8Array = np.array([int(solid.part) for solid in solids], dtype=np.uint8)
        self._solid_of_face: IntArray = np.repeat(
            np.arange(len(solids)), [len(solid.faces) for solid in solids]
        )
        self._triangles = _triangle_table(self.vertices[self.faces])
        # single precision is finest around zero
        self.centre_mm: FloatArray = 0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0))
        offset = self.vertices - self.centre_mm
        self.radius_mm = float(np.sqrt(_dot(offset, offset).max()))
        self._scene = EmbreeScene(robust=True)
        self._mesh = TriangleMesh(
            self._scene,
            offset.astype(np.float32),
            self.faces.astype(np.int32),
        )

    def first_hits(self, origins: FloatArray, directions: FloatArray) -> Hits:
        """Find the nearest surface along each ray.

        Args:
            origins: Shape (N, 3) or (1, 3), mm, frame of the solids.
            directions: Shape (N, 3), unit.

        Returns:
            One row per ray.
        """
        origin_rows = np.broadcast_to(origins, directions.shape)
        answer = self._scene.run(
            np.ascontiguousarray(origin_rows - self.centre_mm, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            dists=np.full(len(directions), _FAR, dtype=np.float32),
            output=1,
        )
        face_index = answer["primID"].astype(np.int64)
        rows = np.flatnonzero(face_index >= 0)
        face = face_index[rows]
        distance, points, normals = self._refine(
            origin_rows[rows], directions[rows], face, answer["tfar"][rows].astype(np.float64)
        )
        distance_mm = np.full(len(directions), np.inf)
        distance_mm[rows] = distance
        solid_index = np.full(len(directions), -1, dtype=np.int64)
        solid_index[rows] = self._solid_of_face[face]
        all_points = np.array(origin_rows, dtype=np.float64)
        all_points[rows] = points
        all_normals = np.zeros((len(directions), 3))
        all_normals[rows] = normals
        return Hits(
            distance_mm=distance_mm,
            face_index=face_index,
            solid_index=solid_index,
            points=all_points,
            normals=all_normals,
        )

    def is_blocked(self, origins: FloatArray, targets: FloatArray) -> BoolArray:
        """Tell whether anything stands between pairs of points.

        Args:
            origins: Shape (N, 3) or (1, 3), mm: a lamp or an eye, off the surface.
            targets: Shape (N, 3), mm, on the surface or anywhere.

        Returns:
            Shape (N,). What is within `SHADOW_GAP_MM` of the target does not count.
        """
        rays = targets - origins
        reach = np.linalg.norm(rays, axis=1)
        rays /= np.maximum(reach, 1e-12)[:, None]
        answer = self._scene.run(
            np.ascontiguousarray(
                np.broadcast_to(origins - self.centre_mm, targets.shape), dtype=np.float32
            ),
            rays.astype(np.float32),
            dists=np.maximum(reach - SHADOW_GAP_MM, 0).astype(np.float32),
            query="OCCLUDED",
        )
        return np.asarray(answer >= 0)

    def _refine(
        self, origins: FloatArray, directions: FloatArray, face: IntArray, rough: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance, point and normal in double precision; the point never leaves its triangle."""
        table = self._triangles[face]
        corner, normals = table[:, 0], table[:, 1]
        slope = _dot(directions, normals)
        height = _dot(corner - origins, normals)
        # a ray within its triangle's plane keeps Embree's distance
        is_steep = np.abs(slope) > _PARALLEL
        distance = np.where(is_steep, height / np.where(is_steep, slope, 1.0), rough)
        points = origins + distance[:, None] * directions
        offset = points - corner
        u, v = _dot(offset, table[:, 2]), _dot(offset, table[:, 3])
        # at an edge the single-precision ray may have met the neighbour of the triangle that the
        # exact ray meets: step back onto the triangle
        outside = np.flatnonzero((u < 0) | (v < 0) | (u + v > 1))
        if len(outside):
            u_in, v_in = np.clip(u[outside], 0, 1), np.clip(v[outside], 0, 1)
            total = np.maximum(u_in + v_in, 1)
            a, b, c = np.moveaxis(self.vertices[self.faces[face[outside]]], 1, 0)
            step_u, step_v = (u_in / total)[:, None] * (b - a), (v_in / total)[:, None] * (c - a)
            points[outside] = a + step_u + step_v
            distance[outside] = _dot(points[outside] - origins[outside], directions[outside])
        return distance, points, normals


def _triangle_table(corners: FloatArray) -> FloatArray:
    """Per triangle: a corner, the unit normal, and two vectors that read off barycentrics.

    Args:
        corners: Shape (F, 3, 3), mm.

    Returns:
        Shape (F, 4, 3); a point's barycentric u and v are its offset from the corner times the
        third and fourth vector.
    """
    edge_u, edge_v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(edge_u, edge_v)
    area2 = np.maximum(_dot(normals, normals), 1e-300)[:, None]
    return np.stack(
        [
            corners[:, 0],
            normals / np.sqrt(area2),
            np.cross(edge_v, normals) / area2,
            np.cross(normals, edge_u) / area2,
        ],
        axis=1,
    )


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    """Row by row."""
    return np.einsum("ij,ij->i", first, second)
