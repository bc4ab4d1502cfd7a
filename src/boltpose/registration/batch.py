"""Point-to-plane steps for many poses at once, against one nearest-point grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import Float32Array, FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.registration.prepare import PreparedPrior

_LEVER_MM = 50.0
"""Rotations are solved for as millimetres at this distance: about half a starter motor."""
_DAMPING = 1e-3
"""Share of the trace added to the diagonal, so that sliding directions stay put."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseBatch:
    """Many guesses of `prior_from_camera`."""

    rotations: FloatArray
    """Shape (B, 3, 3), `prior_from_camera`."""
    translations_mm: FloatArray
    """Shape (B, 3)."""

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, rows: slice | np.ndarray) -> PoseBatch:
        return PoseBatch(self.rotations[rows], self.translations_mm[rows])

    def transforms(self) -> list[Transform]:
        """Return the guesses as `camera_from_prior`."""
        return [
            Transform.from_parts("prior", "camera", rotation, translation).inverse()
            for rotation, translation in zip(self.rotations, self.translations_mm, strict=True)
        ]


def join_batches(batches: list[PoseBatch]) -> PoseBatch:
    """Put batches one behind the other."""
    return PoseBatch(
        np.concatenate([batch.rotations for batch in batches]),
        np.concatenate([batch.translations_mm for batch in batches]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    moved: Float32Array
    normals: Float32Array
    residuals: Float32Array
    distances_squared: Float32Array
    facing: np.ndarray


def _pair(poses: PoseBatch, points: Float32Array, prepared: PreparedPrior) -> _Pairs:
    moved = points @ poses.rotations.transpose(0, 2, 1).astype(np.float32)
    moved += poses.translations_mm[:, None].astype(np.float32)
    index = prepared.grid.nearest(moved)
    normals = prepared.coarse_normals.take(index, axis=0)
    offset = prepared.coarse_points.take(index, axis=0)
    offset -= moved
    residuals = np.einsum("bni,bni->bn", offset, normals)
    distances = np.einsum("bni,bni->bn", offset, offset)
    # the camera's origin in frame prior is the translation: a seen surface faces it
    to_camera = poses.translations_mm[:, None].astype(np.float32) - moved
    facing = np.einsum("bni,bni->bn", to_camera, normals) > 0
    return _Pairs(moved, normals, residuals, distances, facing)


def step_batch(
    poses: PoseBatch, points: Float32Array, prepared: PreparedPrior, max_distance_mm: float
) -> PoseBatch:
    """Move every pose by one damped point-to-plane step.

    Args:
        poses: B guesses.
        points: Shape (N, 3), mm, frame `camera`.
        prepared: The prior.
        max_distance_mm: Pairs farther apart are ignored, nearer ones weigh 1 - (d / max)^2.

    Returns:
        B improved guesses.

    Source:
        Chen and Medioni, Image and Vision Computing 10(3), 1992; batched over start poses.
    """
    pairs = _pair(poses, points, prepared)
    weights = np.maximum(1.0 - pairs.distances_squared / max_distance_mm**2, 0.0) * pairs.facing
    centre = pairs.moved.mean(axis=1, keepdims=True)
    lever = (pairs.moved - centre) / np.float32(_LEVER_MM)
    n = pairs.normals
    jacobian = np.concatenate(
        [
            (lever[..., 1] * n[..., 2] - lever[..., 2] * n[..., 1])[..., None],
            (lever[..., 2] * n[..., 0] - lever[..., 0] * n[..., 2])[..., None],
            (lever[..., 0] * n[..., 1] - lever[..., 1] * n[..., 0])[..., None],
            n,
        ],
        axis=-1,
    )
    weighted = (jacobian * weights[..., None]).transpose(0, 2, 1)
    normal_matrix = (weighted @ jacobian).astype(np.float64)
    right_side = (weighted @ pairs.residuals[..., None])[..., 0].astype(np.float64)
    trace = np.trace(normal_matrix, axis1=1, axis2=2)
    normal_matrix += np.eye(6) * (_DAMPING * trace + 1e-6)[:, None, None]
    motion = np.linalg.solve(normal_matrix, right_side[..., None])[..., 0]
    turn = rotations_from_vectors(motion[:, :3] / _LEVER_MM)
    middle = centre[:, 0].astype(np.float64)
    shifted = poses.translations_mm - middle
    return PoseBatch(
        turn @ poses.rotations,
        (turn @ shifted[..., None])[..., 0] + middle + motion[:, 3:],
    )


def score_batch(
    poses: PoseBatch, points: Float32Array, prepared: PreparedPrior, tolerance_mm: float
) -> FloatArray:
    """Mean agreement, 0 to 1, of the points with the surface under every pose; shape (B,).

    A point counts 1 - (r / tolerance)^2 with its plane residual r, nothing beyond the tolerance,
    far from the surface, or where the surface faces away from the camera.
    """
    pairs = _pair(poses, points, prepared)
    near = pairs.distances_squared < (tolerance_mm + prepared.grid.cell_mm) ** 2
    agreement = np.maximum(1.0 - (pairs.residuals / tolerance_mm) ** 2, 0.0)
    return (agreement * (near & pairs.facing)).mean(axis=1).astype(np.float64)


def rotations_from_vectors(vectors: FloatArray) -> FloatArray:
    """Rotation matrices, (B, 3, 3), of rotation vectors, (B, 3), rad (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)
    safe = np.maximum(angle, 1e-12)
    axis = vectors / safe[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2] = -axis[:, 2], axis[:, 1]
    cross[:, 1, 0], cross[:, 1, 2] = axis[:, 2], -axis[:, 0]
    cross[:, 2, 0], cross[:, 2, 1] = -axis[:, 1], axis[:, 0]
    sine = np.sin(angle)[:, None, None]
    cosine = np.cos(angle)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)
