"""How far the scan lies from the registered prior, point by point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.geometry.transforms import Transform
from boltpose.schema import Prior

FULL_MM = 1.0
"""The darkest colour: five times the largest error of a right pose on reman18 (simulated)."""
REACH_MM = 1.5
"""Points farther from the prior do not belong to the motor, `LocateConfig.relabel_mm`. The mask of
`LocateResult` is not used: a saved result has none, and its report must be the same."""
BINS = 20
"""Of the histogram from 0 to `FULL_MM`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Residuals:
    """Scan points near a posed prior, and their distances to its surface."""

    rows: IntArray
    """Shape (K,), which points of the scan."""
    distance_mm: FloatArray
    """Shape (K,), along the prior's normal, >= 0."""

    def is_near(self, count: int) -> BoolArray:
        """Shape (count,): which of so many scan points these are."""
        mask = np.zeros(count, dtype=np.bool_)
        mask[self.rows] = True
        return mask

    def histogram(self) -> FloatArray:
        """Share of the points per bin, shape (BINS + 1,); the last holds all beyond `FULL_MM`."""
        if not len(self.rows):
            return np.zeros(BINS + 1)
        row = np.minimum((self.distance_mm / FULL_MM * BINS).astype(np.int64), BINS)
        return np.bincount(row, minlength=BINS + 1) / len(self.rows)

    def quantile_mm(self, share: float) -> float:
        """The distance that so many points do not exceed; infinite without points."""
        return float(np.quantile(self.distance_mm, share)) if len(self.rows) else float("inf")


def measure_residuals(
    points_camera: FloatArray, prior: Prior, camera_from_prior: Transform
) -> Residuals:
    """Measure every scan point near a posed prior.

    Args:
        points_camera: Shape (N, 3), mm, the scan.
        prior: The motor.
        camera_from_prior: Its pose.

    Returns:
        The points within `REACH_MM`, and how far they lie beside the surface.
    """
    points = camera_from_prior.inverse().apply(points_camera)
    low, high = prior.points.min(axis=0) - REACH_MM, prior.points.max(axis=0) + REACH_MM
    rows = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    distance, partner = KDTree(prior.points).query(
        points[rows], distance_upper_bound=REACH_MM, workers=-1
    )
    touches = np.isfinite(distance)
    rows, partner = rows[touches], np.asarray(partner)[touches]
    offset = points[rows] - prior.points[partner]
    beside = np.abs(np.einsum("ni,ni->n", offset, prior.normals[partner]))
    return Residuals(rows=rows, distance_mm=beside)


def residual_tints(distance_mm: FloatArray) -> FloatArray:
    """Pale yellow at 0 over orange to nearly black at `FULL_MM`; shapes (N,) to (N, 3).

    The colours only ever get darker, so that they read the same without colours.
    """
    share = np.clip(distance_mm / FULL_MM, 0, 1)
    stops = np.array(
        [
            [1.00, 0.96, 0.72],
            [0.99, 0.76, 0.40],
            [0.86, 0.36, 0.25],
            [0.52, 0.10, 0.36],
            [0.10, 0.02, 0.16],
        ]
    )
    places = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(share, places, stops[:, c]) for c in range(3)], axis=1)
