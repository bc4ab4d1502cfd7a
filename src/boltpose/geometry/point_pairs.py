"""Histograms of point pairs: a description of a surface that no rigid motion changes."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray, IntArray

DISTANCE_CELL_MM = 5.0
DISTANCE_CELLS = 40
"""Pairs up to 200 mm apart, the length of a starter motor; farther ones share the last cell."""
ANGLE_CELLS = 6
"""Cells of each of the three cosines."""
PAIR_WORDS = DISTANCE_CELLS * ANGLE_CELLS**3


def pair_histogram(
    points: FloatArray, normals: FloatArray, pair_weights: FloatArray | None = None
) -> FloatArray:
    """Count how often which pair of oriented points occurs on a surface.

    A pair's word is its distance and the cosines between the line and both normals (in either
    order) and between the normals.

    Args:
        points: Shape (N, 3), N >= 2, mm, any frame, evenly spread.
        normals: Shape (N, 3), unit, outward.
        pair_weights: Shape (N, N), symmetric: what each pair counts; 1 if left out.

    Returns:
        Shape (`PAIR_WORDS`,), sums to 1; zeros if no pair counts.

    Source:
        The pair feature of Drost et al., CVPR 2010; the histogram of Wahl et al., 3DIM 2003. Ours:
        cells of cosines, which need no arc, and no hashing.
    """
    first, second = np.triu_indices(len(points), 1)
    weights = None
    if pair_weights is not None:
        weights = pair_weights[first, second]
        counted = weights > 0
        first, second, weights = first[counted], second[counted], weights[counted]
    words = _pair_words(points.astype(np.float32), normals.astype(np.float32), first, second)
    counts = np.bincount(words, weights=weights, minlength=PAIR_WORDS).astype(np.float64)
    total = float(counts.sum())
    return counts / total if total > 0 else counts


def _pair_words(
    points: np.ndarray, normals: np.ndarray, first: IntArray, second: IntArray
) -> IntArray:
    line = points[second] - points[first]
    distance = np.sqrt(np.einsum("ni,ni->n", line, line))
    line /= np.maximum(distance, np.float32(1e-6))[:, None]
    # seen from either end a convex pair has the same sign
    out = _cell(np.einsum("ni,ni->n", normals[first], line))
    back = _cell(-np.einsum("ni,ni->n", normals[second], line))
    between = _cell(np.einsum("ni,ni->n", normals[first], normals[second]))
    far = np.minimum((distance / np.float32(DISTANCE_CELL_MM)).astype(np.int64), DISTANCE_CELLS - 1)
    word = far * ANGLE_CELLS + np.minimum(out, back)
    return (word * ANGLE_CELLS + np.maximum(out, back)) * ANGLE_CELLS + between


def _cell(cosine: np.ndarray) -> IntArray:
    cell = ((cosine + np.float32(1.0)) * np.float32(0.5 * ANGLE_CELLS)).astype(np.int64)
    return np.clip(cell, 0, ANGLE_CELLS - 1)
