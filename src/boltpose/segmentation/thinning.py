"""Which points of a full scan the networks are shown: no strays, no denser than they know."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import ConfigError
from boltpose.geometry.sampling import voxel_representatives

SPACING_MM = 0.9
"""Point spacing the networks know; denser scans are thinned to it."""
STRAY_RATIO = 5.0
"""Points whose 4th neighbour is this many times farther than usual are strays."""

_SAMPLE = 20_000


def thin_scan(
    points: FloatArray, *, spacing_mm: float = SPACING_MM, stray_ratio: float = STRAY_RATIO
) -> IntArray:
    """Choose the points of a full scan to work on.

    Args:
        points: Shape (N, 3), N >= 2, mm, finite.
        spacing_mm: Scans whose usual spacing is below half of this are thinned to it.
        stray_ratio: Points whose 4th neighbour is this many times farther than usual are left out.

    Returns:
        Shape (M,), indices into the points; in voxel order where the scan was thinned.

    Raises:
        ConfigError: A setting is not positive.
    """
    for name, value in (("spacing_mm", spacing_mm), ("stray_ratio", stray_ratio)):
        if not value > 0:
            raise ConfigError(f"{name} must be > 0, got {value}")
    step = max(1, len(points) // _SAMPLE)
    distance, _ = KDTree(points).query(points[::step], k=2, workers=-1)
    if float(np.median(distance[:, 1])) < spacing_mm / 2:
        keep = voxel_representatives(points, spacing_mm)
    else:
        keep = np.arange(len(points))
    kept = points[keep]
    distance, _ = KDTree(kept).query(kept, k=min(5, len(kept)), workers=-1)
    reach = distance[:, -1]
    return keep[reach <= stray_ratio * float(np.median(reach))]
