"""Smooth random fields: over an image, and over the surface of solids."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csr_array

from boltpose.arrays import Float32Array, FloatArray

_SPLINE_GAIN = 151 / 315
"""Mean of the squared weights of cubic B-splines: the variance left of white noise."""
_WAVES = 6


def image_field(shape: tuple[int, int], length_px: float, rng: np.random.Generator) -> Float32Array:
    """A smooth random image of mean 0 and variance 1.

    Args:
        shape: Rows and columns.
        length_px: Distance over which values change: the knots' spacing.
        rng: Draws the knots.

    Returns:
        Shape `shape`. Sparse sums, not a matrix product of BLAS, so that bits do not depend on
        the number of threads.
    """
    rows, columns = _spline_weights(shape[0], length_px), _spline_weights(shape[1], length_px)
    sizes = (_knot_count(shape[0], length_px), _knot_count(shape[1], length_px))
    knots = rng.standard_normal(sizes, dtype=np.float32)
    narrow = columns @ knots.T
    return np.asarray(rows @ narrow.T, dtype=np.float32) / np.float32(_SPLINE_GAIN)


def surface_field(
    points: FloatArray | Float32Array, length_mm: float, rng: np.random.Generator
) -> Float32Array:
    """A random blotchy function of place, of mean 0 and variance about 1.

    Sums of waves whose phases are bent by other waves: no grid, no repetition within a part, and
    cheap for millions of points.

    Args:
        points: Shape (N, 3), mm, any frame.
        length_mm: Typical size of a blotch.
        rng: Draws the waves.

    Returns:
        Shape (N,).
    """
    place = (points * (math.pi / length_mm)).astype(np.float32)
    value = np.zeros(len(points), dtype=np.float32)
    for _ in range(_WAVES):
        wave, bend = rng.standard_normal((2, 3)) / math.sqrt(3)
        shift, turn = rng.uniform(0, 2 * math.pi, 2)
        bent = np.sin(_project(place, 0.7 * bend, turn))
        value += np.sin(_project(place, 1.4 * wave, shift) + np.float32(1.8) * bent)
    return (value * math.sqrt(2 / _WAVES)).astype(np.float32, copy=False)


def _project(place: Float32Array, direction: FloatArray, shift: float) -> Float32Array:
    x, y, z = (np.float32(value) for value in direction)
    value = place[:, 0] * x + place[:, 1] * y + (place[:, 2] * z + np.float32(shift))
    return value.astype(np.float32, copy=False)


def _spline_weights(count: int, length_px: float) -> csr_array:
    """Shape (count, knots): how cubic B-splines on knots add up at each pixel."""
    position = np.arange(count) / max(length_px, 1.0)
    first = np.floor(position).astype(np.int64)
    t = position - first
    weights = np.stack(
        [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 1 + 3 * t + 3 * t**2 - 3 * t**3, t**3], axis=1
    )
    knots = first[:, None] + np.arange(4)
    return csr_array(
        (
            (weights / 6).astype(np.float32).ravel(),
            knots.ravel(),
            np.arange(0, 4 * count + 1, 4),
        ),
        shape=(count, _knot_count(count, length_px)),
    )


def _knot_count(count: int, length_px: float) -> int:
    return int((count - 1) / max(length_px, 1.0)) + 4
