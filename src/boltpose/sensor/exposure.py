"""What the light does at every pixel that camera and projector both see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from boltpose.arrays import Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Exposure:
    """One row per pixel, exact; pixels ascend."""

    pixels: IntArray
    """Shape (N,), row * width + column."""
    depth_mm: FloatArray
    """Shape (N,), along the optical axis."""
    solid_index: IntArray
    """Shape (N,)."""
    points: Float32Array
    """Shape (N, 3), mm, frame of the solids; single precision, for stains only."""
    cos_eye: Float32Array
    """Shape (N,), cosine between the surface normal and the direction to the camera."""
    cos_lamp: Float32Array
    """Shape (N,), to the projector."""
    cos_half: Float32Array
    """Shape (N,), to the direction half way between them."""
    lamp_distance_mm: Float32Array
    """Shape (N,)."""

    @classmethod
    def joined(cls, pieces: Sequence[Exposure]) -> Exposure:
        """All rows of several exposures in their order."""
        return cls(
            **{
                entry.name: np.concatenate([getattr(piece, entry.name) for piece in pieces])
                for entry in fields(cls)
            }
        )
