"""Scene labels from a registered prior: a scan point near the prior belongs to the motor."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from boltpose.arrays import BoolArray, as_points
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.registration.prepare import PreparedPrior


def relabel(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    scan_points: npt.ArrayLike,
    *,
    threshold_mm: float = 1.5,
) -> BoolArray:
    """Tell which scan points lie on the posed prior.

    Args:
        prepared: The prior.
        camera_from_prior: Its pose.
        scan_points: Shape (N, 3), mm, frame `camera`: the whole scan.
        threshold_mm: Largest distance to the nearest prior point. 1.5 mm labels 99.8 % of the
            reman18 pixels (simulated) as the truth does (FINDINGS section 2).

    Returns:
        Shape (N,), True on the motor.

    Raises:
        ShapeError: `scan_points` is not (N, 3) and finite.
        ConfigError: `threshold_mm` is not positive.
    """
    if not threshold_mm > 0:
        raise ConfigError(f"threshold_mm must be > 0, got {threshold_mm}")
    points = camera_from_prior.inverse().apply(as_points(scan_points, "scan_points", at_least=0))
    reach = prepared.radius_mm + threshold_mm
    near = np.linalg.norm(points - prepared.centre_mm, axis=1) < reach
    candidates = np.flatnonzero(near)
    # the grid's answer is off by at most two half diagonals of a cell and the coarse spacing
    slack = threshold_mm + np.sqrt(3.0) * (prepared.grid.cell_mm + prepared.coarse_spacing_mm)
    inner = points[candidates].astype(np.float32)
    offset = inner - prepared.coarse_points[prepared.grid.nearest(inner)]
    candidates = candidates[np.einsum("ni,ni->n", offset, offset) < slack**2]
    is_motor = np.zeros(len(points), dtype=np.bool_)
    distance, _ = prepared.tree.query(
        points[candidates], distance_upper_bound=threshold_mm, workers=-1
    )
    is_motor[candidates] = np.isfinite(distance)
    return is_motor
