"""The numbers by which the part networks know a point of a full scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, FloatArray
from boltpose.geometry.canonical import CanonicalConfig, CanonicalFrame, find_canonical_frame
from boltpose.geometry.local_features import LocalFeatureConfig, compute_local_features

POSITION_COLUMNS = 13
"""Columns that come from the canonical frame; the local features follow."""

MIRRORED_COLUMNS = [0, 4]
"""Columns that change sign when the motor is mirrored at its y-z plane."""

FEATURE_CONFIG = LocalFeatureConfig()
"""The radii the shipped networks were trained with."""

FEATURE_WIDTH = POSITION_COLUMNS + FEATURE_CONFIG.width
"""Number of columns of `features`."""

CONTEXT_RADII_MM = (3.0, 6.0, 12.0)
"""Neighbourhoods over which stage one's probabilities are averaged for stage two."""

INPUT_WIDTH = FEATURE_WIDTH + 6 * (1 + len(CONTEXT_RADII_MM))
"""Number of columns stage two reads."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PartFeatures:
    """A full scan as the part networks see it."""

    frame: CanonicalFrame
    points_canonical: FloatArray
    """Shape (N, 3), mm, frame `canonical`."""
    features: Float32Array
    """Shape (N, FEATURE_WIDTH)."""


def compute_part_features(
    points_prior: npt.ArrayLike,
    normals: npt.ArrayLike,
    *,
    seed: int = 0,
    config: CanonicalConfig | None = None,
) -> PartFeatures:
    """Turn a full scan into its canonical frame and describe every point.

    Args:
        points_prior: Shape (N, 3), N >= 100, mm, frame `prior`.
        normals: Shape (N, 3), unit, outward.
        seed: Of the search for the canonical frame.
        config: Of the same search.

    Returns:
        The features, one row per point, in the order of the points.

    Raises:
        ShapeError: An argument has the wrong shape.
        DegenerateGeometryError: The scan has no canonical frame.
    """
    frame = find_canonical_frame(points_prior, normals, seed=seed, config=config)
    points = frame.canonical_from_prior.apply(points_prior)
    return PartFeatures(
        frame=frame,
        points_canonical=points,
        features=describe_canonical(points, frame.canonical_from_prior.rotate(normals), frame),
    )


def describe_canonical(
    points_canonical: FloatArray, normals: FloatArray, frame: CanonicalFrame
) -> Float32Array:
    """Describe points that are in the canonical frame already; shape (N, FEATURE_WIDTH).

    The first `POSITION_COLUMNS` are: x, y, z (50 mm); distance from the main axis (50 mm); the
    normal's x, y, z; its share away from the main axis; height above the lower and below the
    upper end (100 mm); distance from the main axis in main radii; distance from the second
    cylinder's axis (50 mm); the normal's share away from it.
    """
    xy, normal_xy = points_canonical[:, :2], normals[:, :2]
    from_main = np.linalg.norm(xy, axis=1)
    to_second = xy - np.array([0.0, frame.second_offset_mm])
    from_second = np.linalg.norm(to_second, axis=1)
    low, high = frame.z_range_mm
    position = np.column_stack(
        [
            points_canonical / 50,
            from_main / 50,
            normals,
            np.einsum("ni,ni->n", xy, normal_xy) / np.maximum(from_main, 1e-6),
            (points_canonical[:, 2] - low) / 100,
            (high - points_canonical[:, 2]) / 100,
            from_main / frame.main_radius_mm,
            from_second / 50,
            np.einsum("ni,ni->n", to_second, normal_xy) / np.maximum(from_second, 1e-6),
        ]
    )
    local = compute_local_features(points_canonical, normals, (0.0, 0.0, 1.0), FEATURE_CONFIG)
    return np.concatenate([position.astype(np.float32), local], axis=1)


def assemble_inputs(
    features: Float32Array, local: Float32Array, around: Float32Array
) -> Float32Array:
    """Join what stage two reads.

    Args:
        features: Shape (N, FEATURE_WIDTH).
        local: Shape (N, 6), stage one's probabilities.
        around: Shape (N, 18), their averages over the neighbourhoods of `CONTEXT_RADII_MM`.

    Returns:
        Shape (N, INPUT_WIDTH).
    """
    return np.concatenate([features, local, around], axis=1, dtype=np.float32)
