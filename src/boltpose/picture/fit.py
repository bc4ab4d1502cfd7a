"""How well a registered prior lies on a scan, in colours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray
from boltpose.picture import paint

FULL_MM = 1.0
"""Drawn in full red: five times the largest error of a right pose on reman18 (simulated)."""
_REACH_MM = 4.0
"""Scan points farther from the prior than this do not belong to it."""
_AROUND_MM = 40.0
"""So much of the surroundings is shown."""


def tint_fit(
    points_camera: FloatArray,
    is_motor: BoolArray,
    motor_camera: FloatArray,
    normals_camera: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Colour a scan by its distance to a prior, and put the prior beneath it.

    Args:
        points_camera: Shape (N, 3), mm, the scan.
        is_motor: Shape (N,), which points are coloured; if none is set, all near ones.
        motor_camera: Shape (M, 3), mm, the registered prior.
        normals_camera: Shape (M, 3), unit.

    Returns:
        Points, shape (K, 3), mm, and their colours, shape (K, 3).
    """
    low, high = motor_camera.min(axis=0) - _AROUND_MM, motor_camera.max(axis=0) + _AROUND_MM
    near = ((points_camera >= low) & (points_camera <= high)).all(axis=1)
    shown = points_camera[near]
    tints = np.tile(paint.SURROUNDINGS, (len(shown), 1))
    distance, index = KDTree(motor_camera).query(shown, distance_upper_bound=_REACH_MM, workers=-1)
    touches = np.isfinite(distance)
    if is_motor.any():
        # a clamp lies close to the prior too; its distance would look like a bad fit
        touches &= is_motor[near]
    partner = np.asarray(index)[touches]
    offset = shown[touches] - motor_camera[partner]
    beside_mm = np.abs(np.einsum("ni,ni->n", offset, normals_camera[partner]))
    tints[touches] = paint.distance_tints(beside_mm, FULL_MM)
    # towards the camera by a hair, so that the scan wins where both lie on the same surface
    pulled = shown * (1 - 1.0 / np.linalg.norm(shown, axis=1, keepdims=True))
    prior_tints = np.tile(paint.PRIOR, (len(motor_camera), 1))
    return np.vstack([pulled, motor_camera]), np.vstack([tints, prior_tints])
