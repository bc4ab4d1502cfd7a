"""What a predictor is: whatever labels the points of a full scan or of a view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, FloatArray, UInt8Array, as_points
from boltpose.errors import ShapeError
from boltpose.geometry.canonical import CanonicalFrame
from boltpose.schema import Part

PARTS = tuple(part for part in Part if part is not Part.BACKGROUND)
"""Classes in the order of the columns of probabilities."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PartProbabilities:
    """Which part every point of a full scan belongs to."""

    probabilities: Float32Array
    """Shape (N, 6), rows sum to 1; columns are `Part` 1 to 6."""
    frame: CanonicalFrame | None = None
    """The label-free frame the labels were found in, where the predictor uses one."""

    @property
    def labels(self) -> UInt8Array:
        """Shape (N,), the most probable `Part` of every point."""
        return (self.probabilities.argmax(axis=1) + 1).astype(np.uint8)

    def of(self, part: Part) -> Float32Array:
        """Shape (N,), probability of one part."""
        return self.probabilities[:, PARTS.index(part)]


def as_full_scan(
    points_prior: npt.ArrayLike, normals: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Check the arguments of a `PartPredictor`; points and normals, (N, 3), N >= 100, float64.

    Raises:
        ShapeError: An argument has the wrong shape, too few rows or values that are not finite.
    """
    cloud = as_points(points_prior, "points_prior", at_least=100)
    directions = as_points(normals, "normals")
    if directions.shape != cloud.shape:
        raise ShapeError(f"normals must have shape {cloud.shape}, got {directions.shape}")
    return cloud, directions


class PartPredictor(Protocol):
    """Tells the parts of a full scan."""

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        """Label every point.

        Args:
            points_prior: Shape (N, 3), mm, frame `prior`.
            normals: Shape (N, 3), unit, outward.
        """
        ...


class ScenePredictor(Protocol):
    """Tells the motor from clamp and background in a view."""

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        """Probability, shape (N,), that each point is on the motor.

        Args:
            points_camera: Shape (N, 3), mm, frame `camera`.
        """
        ...
