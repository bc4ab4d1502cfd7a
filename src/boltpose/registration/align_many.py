"""Point-to-plane steps of many motors at once against the points of one view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, Float32Array, FloatArray, IntArray, freeze
from boltpose.errors import ConfigError
from boltpose.registration.batch import PoseBatch, rotations_from_vectors

_APART_MM = 5000.0
"""Surfaces lie this far from each other in the common tree: none meets its neighbour."""
_LEVER_MM = 50.0
"""Rotations are solved for as millimetres at this distance, as in the coarse stage."""
_DAMPING = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignRound:
    """One round of aligning many priors at once."""

    points: int
    """Motor points."""
    steps: int
    distance_mm: tuple[float, float]
    """Largest pair distance in the first and the last step."""
    tolerance_mm: float
    """A point's agreement falls to 0 at this plane residual."""

    def __post_init__(self) -> None:
        if not (self.points >= 6 and self.steps >= 1 and self.tolerance_mm > 0):
            raise ConfigError(
                f"a round needs points >= 6, steps >= 1 and tolerance_mm > 0, "
                f"got {self.points}, {self.steps} and {self.tolerance_mm}"
            )
        start, end = self.distance_mm
        if not 0 < end <= start:
            raise ConfigError(f"distance_mm must fall from a positive start, got {start} to {end}")


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Several motors' surfaces in one search tree; make it by `join_surfaces`."""

    points: Float32Array
    """Shape (sum of K, 3), mm, each in its own frame."""
    normals: Float32Array
    """Shape (sum of K, 3), unit, outward."""
    tree: KDTree
    """Over `points`, motor i moved by i times 5 m along x."""
    spacing_mm: float
    """About how far apart the points are."""


def join_surfaces(
    points: Sequence[Float32Array], normals: Sequence[Float32Array], spacing_mm: float
) -> Surfaces:
    """Put the surfaces of several motors, points and normals (K, 3) each, into one tree."""
    together = np.concatenate(points)
    placed = together.astype(np.float64)
    placed[:, 0] += np.repeat(np.arange(len(points)), [len(part) for part in points]) * _APART_MM
    # built in half the time of a balanced one, for some ten thousand questions
    tree = KDTree(placed, balanced_tree=False, compact_nodes=False)
    return Surfaces(freeze(together), freeze(np.concatenate(normals)), tree, spacing_mm)


def settle(
    surfaces: Surfaces,
    rows: IntArray,
    poses: PoseBatch,
    view: tuple[FloatArray, FloatArray],
    config: AlignRound,
    min_facing: float,
) -> tuple[PoseBatch, FloatArray]:
    """Move every surface onto the points of a view by damped point-to-plane steps.

    Args:
        surfaces: What is moved.
        rows: Shape (R,): which surface each pose is of; one may come several times.
        poses: R guesses of the pose of the camera in the surface's frame.
        view: Points and normals, (N, 3) each, mm, frame `camera`; the first `config.points` count.
        config: Steps and tolerance.
        min_facing: Cosine that the normals of a pair must reach.

    Returns:
        R better guesses, and for each the mean agreement of the points, (R,), 0 to 1: a point
        counts 1 - (r / tolerance)^2 with its plane residual r.

    Source:
        Chen and Medioni, Image and Vision Computing 10(3), 1992; batched over many models.
    """
    points = view[0][: config.points].astype(np.float32)
    normals = view[1][: config.points].astype(np.float32)
    for distance in np.geomspace(*config.distance_mm, config.steps):
        pairs = _pair(surfaces, rows, poses, points, normals, min_facing)
        poses = _step(poses, pairs, float(distance))
    pairs = _pair(surfaces, rows, poses, points, normals, min_facing)
    # between two points of a surface it goes on
    near = pairs.distances_squared < (config.tolerance_mm + surfaces.spacing_mm) ** 2
    agreement = np.maximum(1.0 - (pairs.residuals / config.tolerance_mm) ** 2, 0.0)
    return poses, (agreement * (near & pairs.is_facing)).mean(axis=1).astype(np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    moved: Float32Array
    """Shape (R, N, 3), mm, in the frame of the surface."""
    normals: Float32Array
    """Shape (R, N, 3), of the partners."""
    residuals: Float32Array
    distances_squared: Float32Array
    is_facing: BoolArray


def _pair(
    surfaces: Surfaces,
    rows: IntArray,
    poses: PoseBatch,
    points: Float32Array,
    normals: Float32Array,
    min_facing: float,
) -> _Pairs:
    turn = poses.rotations.transpose(0, 2, 1).astype(np.float32)
    moved = points @ turn + poses.translations_mm[:, None].astype(np.float32)
    placed = moved.astype(np.float64)
    placed[..., 0] += _APART_MM * rows[:, None]
    _, partner = surfaces.tree.query(placed.reshape(-1, 3), workers=-1)
    partner = np.asarray(partner).reshape(moved.shape[:2])
    partner_normals = surfaces.normals[partner]
    offset = surfaces.points[partner] - moved
    return _Pairs(
        moved,
        partner_normals,
        np.einsum("rni,rni->rn", offset, partner_normals),
        np.einsum("rni,rni->rn", offset, offset),
        np.einsum("rni,rni->rn", normals @ turn, partner_normals) > min_facing,
    )


def _step(poses: PoseBatch, pairs: _Pairs, max_distance_mm: float) -> PoseBatch:
    weights = np.maximum(1.0 - pairs.distances_squared / max_distance_mm**2, 0.0) * pairs.is_facing
    centre = pairs.moved.mean(axis=1, keepdims=True)
    lever = (pairs.moved - centre) / np.float32(_LEVER_MM)
    jacobian = np.concatenate([np.cross(lever, pairs.normals), pairs.normals], axis=-1)
    weighted = (jacobian * weights[..., None]).transpose(0, 2, 1)
    matrix = (weighted @ jacobian).astype(np.float64)
    trace = np.trace(matrix, axis1=1, axis2=2)
    matrix += np.eye(6) * (_DAMPING * trace + 1e-6)[:, None, None]
    right_side = (weighted @ pairs.residuals[..., None]).astype(np.float64)
    motion = np.linalg.solve(matrix, right_side)[..., 0]
    turn = rotations_from_vectors(motion[:, :3] / _LEVER_MM)
    middle = centre[:, 0].astype(np.float64)
    shifted = (turn @ (poses.translations_mm - middle)[..., None])[..., 0]
    return PoseBatch(turn @ poses.rotations, shifted + middle + motion[:, 3:])
