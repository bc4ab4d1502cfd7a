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

NEGLIGIBLE_MM3 = 1e-3
"""An overlap smaller than a cube of 0.1 mm is rounding of the cut, not depth."""

FIRST_REACH_MM = 1.0
"""How far the nearest triangle is looked for first; most overlaps are shallower."""

_CHUNK = 512


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
    nearest point of the other surface at points `DEPTH_STEP_MM` apart. Overlaps of less than
    `NEGLIGIBLE_MM3` count as touching.
    """
    deepest = 0.0
    for one in first:
        for other in second:
            if one.near(other):
                overlap = one.body ^ other.body
                if overlap.volume() > NEGLIGIBLE_MM3:
                    deepest = max(deepest, _depth_mm(overlap, one.body, other.body))
    return deepest


def _depth_mm(overlap: Manifold, first: Manifold, second: Manifold) -> float:
    """Depth of one overlap."""
    points, _ = mesh_arrays(overlap.refine_to_length(DEPTH_STEP_MM))
    return max(float(distance_to_surface(points, body).max()) for body in (first, second))


def distance_to_surface(points: FloatArray, body: Manifold) -> FloatArray:
    """Distance of points to the nearest triangle of a body.

    Args:
        points: Shape (N, 3), mm.
        body: What the distance is to; its surface, so that points inside have a distance too.

    Returns:
        Shape (N,), mm.
    """
    vertices, faces = mesh_arrays(body)
    corners = vertices[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    best = np.full(len(points), np.inf)
    reach = FIRST_REACH_MM
    open_points = np.arange(len(points))
    while len(open_points):
        some = points[open_points]
        near = np.flatnonzero(
            (low <= some.max(axis=0) + reach).all(axis=1)
            & (high >= some.min(axis=0) - reach).all(axis=1)
        )
        squared = np.full(len(some), np.inf)
        for start in range(0, len(near), _CHUNK):
            chunk = near[start : start + _CHUNK]
            pairs = (some[:, None] >= low[chunk] - reach).all(axis=2) & (
                some[:, None] <= high[chunk] + reach
            ).all(axis=2)
            row, column = np.nonzero(pairs)
            found = _squared_distance(some[row], corners[chunk[column]])
            np.minimum.at(squared, row, found)
        settled = squared <= reach**2
        best[open_points[settled]] = np.sqrt(squared[settled])
        open_points = open_points[~settled]
        reach *= 4
    return best


def _squared_distance(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Squared distance of points, shape (K, 3), each to its own triangle, shape (K, 3, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    area2 = np.einsum("ij,ij->i", normal, normal)
    best = np.full(len(points), np.inf)
    inside = area2 > 1e-18
    for start, end in ((a, b), (b, c), (c, a)):
        edge, offset = end - start, points - start
        length2 = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-18)
        along = np.clip(np.einsum("ij,ij->i", offset, edge) / length2, 0, 1)
        gap = offset - along[:, None] * edge
        best = np.minimum(best, np.einsum("ij,ij->i", gap, gap))
        inside &= np.einsum("ij,ij->i", np.cross(edge, offset), normal) >= 0
    height = np.einsum("ij,ij->i", points - a, normal)
    return np.where(inside, height**2 / np.maximum(area2, 1e-18), best)
