"""Where clamp and motor touch: nests cut to the motor, and how deep solids go into each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.factory.clamps.assembly import ClampBody, InfeasibleError
from boltpose.factory.solids import Manifold, OpType, mesh_arrays

FRAGMENT_SHARE = 0.15
"""A piece that the motor cuts off a clamp and that is larger than this was needed."""

DEPTH_STEP_MM = 0.8
"""Spacing of the points at which the depth of an overlap is measured."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoxedBody:
    """A solid and its bounding box, asked for once."""

    body: Manifold
    low: FloatArray
    high: FloatArray

    def near(self, other: BoxedBody) -> bool:
        """Whether the boxes overlap."""
        return bool((self.low < other.high).all() and (other.low < self.high).all())


def boxed(body: Manifold) -> BoxedBody:
    """Ask a body for its bounding box."""
    bounds = np.asarray(body.bounding_box())
    return BoxedBody(body=body, low=bounds[:3], high=bounds[3:])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Nested:
    """A clamp after the motor was cut out of it."""

    bodies: tuple[ClampBody, ...]
    touching: int
    """How many of its pieces touch the motor."""


def cut_nests(bodies: Sequence[ClampBody], motor: Sequence[BoxedBody]) -> Nested:
    """Take the motor out of every piece that touches it.

    Args:
        bodies: The clamp, frame `table`.
        motor: The motor's parts, frame `table`.

    Raises:
        InfeasibleError: The motor goes deeper into a piece than that may give, or cuts it in two.
    """
    result: list[ClampBody] = []
    touching = 0
    for piece in bodies:
        box = boxed(piece.body)
        overlaps = [
            (part, overlap)
            for part in motor
            if part.near(box) and not (overlap := piece.body ^ part.body).is_empty()
        ]
        if not overlaps:
            result.append(piece)
            continue
        for _, overlap in overlaps:
            # twice volume over surface is the mean thickness of a thin lens
            if 2 * overlap.volume() > piece.give_mm * overlap.surface_area():
                raise InfeasibleError(f"{piece.name} is in the motor's way")
        touching += 1
        cut = Manifold.batch_boolean(
            [piece.body, *(part.body for part, _ in overlaps)], OpType.Subtract
        )
        result.append(replace(piece, body=_largest_piece(cut, piece.name)))
    return Nested(bodies=tuple(result), touching=touching)


def _largest_piece(body: Manifold, name: str) -> Manifold:
    """Drop what the cut left behind as crumbs."""
    pieces = body.decompose()
    if not pieces:
        raise InfeasibleError(f"{name} would vanish in the motor")
    if len(pieces) == 1:
        return pieces[0]
    volumes = np.array([piece.volume() for piece in pieces])
    largest = int(np.argmax(volumes))
    if volumes.sum() - volumes[largest] > FRAGMENT_SHARE * volumes.sum():
        raise InfeasibleError(f"{name} would be cut in two")
    return pieces[largest]


def overlap_depth_mm(first: Sequence[BoxedBody], second: Sequence[BoxedBody]) -> float:
    """How deep any solid of one group goes into any of the other.

    The depth is that of the deepest point of one surface inside the other solid, measured to the
    nearest point of the other surface at points `DEPTH_STEP_MM` apart.
    """
    deepest = 0.0
    for one in first:
        for other in second:
            if one.near(other):
                overlap = one.body ^ other.body
                if not overlap.is_empty():
                    deepest = max(deepest, _depth_mm(overlap, one.body, other.body))
    return deepest


def _depth_mm(overlap: Manifold, first: Manifold, second: Manifold) -> float:
    """Depth of one overlap."""
    bounds = np.asarray(overlap.bounding_box())
    if (bounds[3:] - bounds[:3]).min() < 1e-6:
        return 0.0
    points, _ = mesh_arrays(overlap.refine_to_length(DEPTH_STEP_MM))
    # deeper than the overlap is thick no point can be
    limit = float((bounds[3:] - bounds[:3]).max())
    return max(float(distance_to_surface(points, body, limit).max()) for body in (first, second))


def distance_to_surface(points: FloatArray, body: Manifold, limit_mm: float) -> FloatArray:
    """Distance of points to the nearest triangle of a body, shape (N,), at most the limit."""
    vertices, faces = mesh_arrays(body)
    corners = vertices[faces]
    low, high = points.min(axis=0) - limit_mm, points.max(axis=0) + limit_mm
    near = (corners.max(axis=1) >= low).all(axis=1) & (corners.min(axis=1) <= high).all(axis=1)
    best = np.full(len(points), limit_mm**2)
    for a, b, c in corners[near]:
        np.minimum(best, _squared_distance(points, a, b, c), out=best)
    return np.sqrt(best)


def _squared_distance(
    points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray
) -> FloatArray:
    """Squared distance of points to one triangle."""
    normal = np.cross(b - a, c - a)
    area2 = float(normal @ normal)
    best = np.full(len(points), np.inf)
    inside = np.full(len(points), area2 > 1e-18)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        offset = points - start
        along = np.clip(offset @ edge / max(float(edge @ edge), 1e-18), 0, 1)
        gap = offset - along[:, None] * edge
        best = np.minimum(best, np.einsum("ij,ij->i", gap, gap))
        inside &= np.cross(edge, offset) @ normal >= 0
    if area2 > 1e-18:
        best = np.where(inside, ((points - a) @ normal) ** 2 / area2, best)
    return best
