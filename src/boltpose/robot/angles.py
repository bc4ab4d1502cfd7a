"""Rotations as robot controllers write them, and numbers as their files hold them."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray

_LOCKED = 1e-7
"""Cosine of the middle angle below which the other two turn about one axis; rad of error made."""


def rotation_vector_rad(rotation: FloatArray) -> FloatArray:
    """Axis times angle, rad, as URScript poses hold it; shape (3,), angle 0 to pi.

    Source: Universal Robots, script manual, "pose": the last three numbers are an axis angle.

    Args:
        rotation: Shape (3, 3).
    """
    return np.asarray(Rotation.from_matrix(rotation).as_rotvec())


def zyx_angles_deg(rotation: FloatArray) -> tuple[float, float, float]:
    """Angles about z, then the new y, then the new x, in degrees.

    `rotation = Rz(a) Ry(b) Rx(c)`. KUKA's A, B, C are (a, b, c). FANUC's W, P, R turn about the
    fixed axes x, y, z, which is the same product: they are (c, b, a). Looking along x of the base
    (b = +-90) only a - c or a + c is determined; then a is 0.

    The last angle is taken from what is left after undoing the first: near b = +-90 an error of
    the first, which is large there, is made good by the last and the pose stays exact.

    Source: KUKA System Software, expert programming, FRAME; FANUC handling tool manual, W P R.

    Args:
        rotation: Shape (3, 3).
    """
    cosine = math.hypot(rotation[0, 0], rotation[1, 0])
    b = math.atan2(-rotation[2, 0], cosine)
    a = math.atan2(rotation[1, 0], rotation[0, 0]) if cosine > _LOCKED else 0.0
    sin_a, cos_a = math.sin(a), math.cos(a)
    c = math.atan2(
        sin_a * rotation[0, 2] - cos_a * rotation[1, 2],
        cos_a * rotation[1, 1] - sin_a * rotation[0, 1],
    )
    return math.degrees(a), math.degrees(b), math.degrees(c)


def fixed(value: float, decimals: int) -> str:
    """Write a number with fixed decimals and without a negative zero."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0 else text
