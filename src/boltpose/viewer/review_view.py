"""From where a bolt's head is best looked at."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.schema import Prior, PriorBolt

_AWAY_MM = 230.0
"""Shows the head large, and enough around it to know where on the motor one is."""
_TILT_RAD = np.deg2rad(35.0)
"""Off the axis: face and flank are both seen."""
_AZIMUTHS = 12


def look_from(prior: Prior, bolt: PriorBolt) -> FloatArray:
    """Choose the viewer's place, shape (3,), mm, frame `prior`: obliquely before the head.

    Of several places around the axis the one with the least surface in between is taken.
    """
    pose = bolt.prior_from_bolt
    head = pose.translation_mm
    offset = prior.points - head
    away = offset @ pose.z_axis
    front = offset[(away > 1.0) & (away < _AWAY_MM)]
    angles = np.arange(_AZIMUTHS) * 2 * np.pi / _AZIMUTHS
    directions = pose.rotate(
        np.column_stack(
            [
                np.sin(_TILT_RAD) * np.cos(angles),
                np.sin(_TILT_RAD) * np.sin(angles),
                np.full(_AZIMUTHS, np.cos(_TILT_RAD)),
            ]
        )
    )
    blocked = [_blocking(front, direction) for direction in directions]
    return head + _AWAY_MM * directions[int(np.argmin(blocked))]


def _blocking(front: FloatArray, direction: FloatArray) -> int:
    along = front @ direction
    beside = np.linalg.norm(front - np.outer(along, direction), axis=1)
    # a cone from the viewer to the head and its surroundings
    return int((beside < 15.0 * np.clip(1.0 - along / _AWAY_MM, 0.0, 1.0)).sum())
