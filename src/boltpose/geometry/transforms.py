"""Rigid motions that know their frames and refuse to be chained wrongly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray, freeze
from boltpose.errors import FrameError

ROTATION_TOLERANCE = 2e-3
"""Largest accepted entry of R Rt - 1: six-decimal files pass, scaled or sheared ones do not."""


@dataclass(frozen=True, slots=True, eq=False)
class Transform:
    """`target_from_source`: takes coordinates in `source` to coordinates in `target`.

    Chaining cancels the inner name: `camera_from_prior @ prior_from_bolt` is
    `camera_from_bolt`. Lengths are mm; points are rows, vectors in the maths are columns.
    The rotation part is made orthonormal on entry, so rounded files cost no accuracy.
    """

    target: str
    source: str
    matrix: FloatArray
    """Shape (4, 4), float64, last row 0 0 0 1, rotation part orthonormal with det +1."""

    def __post_init__(self) -> None:
        name = f"{self.target}_from_{self.source}"
        matrix = np.array(self.matrix, dtype=np.float64)
        if matrix.shape != (4, 4):
            raise FrameError(f"{name} must have shape (4, 4), got {matrix.shape}")
        if not np.isfinite(matrix).all():
            raise FrameError(f"{name} must be finite, got {matrix.tolist()}")
        if np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-9:
            raise FrameError(f"last row of {name} must be 0 0 0 1, got {matrix[3].tolist()}")
        rotation = matrix[:3, :3]
        error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if error > ROTATION_TOLERANCE:
            raise FrameError(f"{name} is no rigid motion: R Rt differs from 1 by {error:.3g}")
        if np.linalg.det(rotation) < 0:
            raise FrameError(f"{name} mirrors: det of the rotation part is -1, wanted +1")
        # what is orthonormal already keeps its bits, so that writing and reading changes nothing
        if error > 1e-13:
            left, _, right = np.linalg.svd(rotation)
            matrix[:3, :3] = left @ right
        matrix[3] = (0, 0, 0, 1)
        object.__setattr__(self, "matrix", freeze(matrix))

    @classmethod
    def identity(cls, target: str, source: str) -> Transform:
        """Return the motion that moves nothing."""
        return cls(target, source, np.eye(4))

    @classmethod
    def from_parts(
        cls, target: str, source: str, rotation: npt.ArrayLike, translation_mm: npt.ArrayLike
    ) -> Transform:
        """Build from a rotation, shape (3, 3), and a translation, shape (3,), mm."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.asarray(rotation, dtype=np.float64)
        matrix[:3, 3] = np.asarray(translation_mm, dtype=np.float64)
        return cls(target, source, matrix)

    @property
    def rotation(self) -> FloatArray:
        """Shape (3, 3); its columns are the axes of `source` seen in `target`."""
        return self.matrix[:3, :3]

    @property
    def translation_mm(self) -> FloatArray:
        """Shape (3,), mm; the origin of `source` seen in `target`."""
        return self.matrix[:3, 3]

    @property
    def z_axis(self) -> FloatArray:
        """Shape (3,), unit; the z axis of `source` seen in `target`."""
        return self.matrix[:3, 2]

    @property
    def quaternion_wxyz(self) -> FloatArray:
        """Shape (4,), unit, scalar first and not negative."""
        return Rotation.from_matrix(self.rotation).as_quat(canonical=True, scalar_first=True)

    def __matmul__(self, other: Transform) -> Transform:
        if self.source != other.target:
            raise FrameError(
                f"cannot chain {self.target}_from_{self.source} @ "
                f"{other.target}_from_{other.source}: '{self.source}' is not '{other.target}'"
            )
        return Transform(self.target, other.source, self.matrix @ other.matrix)

    def inverse(self) -> Transform:
        """Return `source_from_target`."""
        rotation = self.rotation.T
        return Transform.from_parts(
            self.source, self.target, rotation, -rotation @ self.translation_mm
        )

    def apply(self, points: npt.ArrayLike) -> FloatArray:
        """Move points, shape (..., 3), mm, from `source` to `target`."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation_mm

    def rotate(self, vectors: npt.ArrayLike) -> FloatArray:
        """Turn directions, shape (..., 3), from `source` to `target`; no translation."""
        return np.asarray(vectors, dtype=np.float64) @ self.rotation.T


def angle_between_rad(first: npt.ArrayLike, second: npt.ArrayLike) -> FloatArray:
    """Angle between vectors, shape (..., 3), in radians, exact for tiny angles too.

    The arc cosine of a dot product reads 0 below 1e-8 rad; the arc tangent of cross over dot
    does not.
    """
    a = np.asarray(first, dtype=np.float64)
    b = np.asarray(second, dtype=np.float64)
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.arctan2(cross, np.sum(a * b, axis=-1)))


def rotation_angle_rad(rotation: npt.ArrayLike) -> float:
    """Angle of a rotation matrix, shape (3, 3), in radians."""
    return float(Rotation.from_matrix(np.asarray(rotation, dtype=np.float64)).magnitude())
