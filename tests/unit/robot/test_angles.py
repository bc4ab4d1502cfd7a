"""Angles against SciPy, spatialmath and formulas printed by a third party."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import spatialmath as sm
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.robot.angles import fixed, rotation_vector_rad, zyx_angles_deg

CUBE = [
    np.array(rows, dtype=float)
    for rows in (
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    )
    if np.linalg.det(rows) > 0
]
"""The 24 rotations that take base axes to base axes; 8 of them are locked."""
angles = st.floats(-math.pi, math.pi)
units = st.floats(-1, 1)


def turned(rotation, other) -> float:
    return float(Rotation.from_matrix(rotation.T @ other).magnitude())


def from_zyx(a, b, c):
    """spatialmath: turns about z, then the new y, then the new x."""
    return (sm.SO3.Rz(a, unit="deg") * sm.SO3.Ry(b, unit="deg") * sm.SO3.Rx(c, unit="deg")).A


def from_fanuc(w, p, r):
    """The quaternion that Roboception's manual prints for FANUC's W, P, R."""
    w, p, r = (math.radians(value) / 2 for value in (w, p, r))
    cos, sin = math.cos, math.sin
    xyzw = (
        cos(r) * cos(p) * sin(w) - sin(r) * sin(p) * cos(w),
        cos(r) * sin(p) * cos(w) + sin(r) * cos(p) * sin(w),
        sin(r) * cos(p) * cos(w) - cos(r) * sin(p) * sin(w),
        cos(r) * cos(p) * cos(w) + sin(r) * sin(p) * sin(w),
    )
    return Rotation.from_quat(xyzw).as_matrix()


def check_all(rotation, tolerance: float) -> None:
    a, b, c = zyx_angles_deg(rotation)
    assert turned(rotation, from_zyx(a, b, c)) <= tolerance
    assert turned(rotation, from_fanuc(c, b, a)) <= tolerance
    fixed_axes = Rotation.from_euler("xyz", (c, b, a), degrees=True).as_matrix()
    assert turned(rotation, fixed_axes) <= tolerance
    assert -90 <= b <= 90
    assert max(abs(a), abs(c)) <= 180
    vector = rotation_vector_rad(rotation)
    assert np.linalg.norm(vector) <= math.pi + 1e-12
    assert turned(rotation, sm.SO3.EulerVec(vector).A) <= tolerance


def test_the_cube_has_all_24() -> None:
    assert len({tuple(rotation.ravel()) for rotation in CUBE}) == 24


@pytest.mark.parametrize("rotation", CUBE)
def test_bolts_along_the_axes_of_the_base(rotation) -> None:
    check_all(rotation, 2e-7)


@pytest.mark.parametrize("size", [1e-15, 1e-12, 1e-9, 1e-8, 1e-7, 2e-7, 1e-6, 1e-4, 1e-2])
def test_close_to_gimbal_lock_the_pose_stays_exact(size: float) -> None:
    rng = np.random.default_rng(7)
    for rotation in CUBE:
        for _ in range(5):
            close = rotation @ Rotation.from_rotvec(size * rng.normal(size=3)).as_matrix()
            check_all(close, 3e-7)


@pytest.mark.parametrize("rotation", [one for one in CUBE if abs(one[2, 0]) == 1])
def test_in_gimbal_lock_noise_does_not_choose_the_angles(rotation) -> None:
    rng = np.random.default_rng(3)
    exact = zyx_angles_deg(rotation)
    assert exact[0] == 0.0
    for _ in range(20):
        close = Rotation.from_rotvec(1e-9 * rng.normal(size=3)).as_matrix() @ rotation
        a, b, c = zyx_angles_deg(close)
        assert a == 0.0
        assert b == pytest.approx(exact[1], abs=1e-5)
        assert math.remainder(c - exact[2], 360.0) == pytest.approx(0.0, abs=1e-5)


@given(angles, angles, units, units)
def test_any_rotation(first: float, second: float, x: float, y: float) -> None:
    axis = np.array([x, y, 1.0])
    spin = Rotation.from_rotvec(first * axis / np.linalg.norm(axis))
    check_all((spin * Rotation.from_euler("z", second)).as_matrix(), 3e-7)


def test_a_known_pose_of_each_vendor() -> None:
    down = np.diag([1.0, -1.0, -1.0])  # the tool looks at the floor, x forward
    assert zyx_angles_deg(down) == pytest.approx((0.0, 0.0, 180.0))
    assert rotation_vector_rad(down) == pytest.approx((math.pi, 0.0, 0.0))
    ahead = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # z along x of the base
    assert zyx_angles_deg(ahead) == pytest.approx((0.0, 90.0, 0.0))
    assert rotation_vector_rad(ahead) == pytest.approx((0.0, math.pi / 2, 0.0))
    # A 30, B 0, C 180 in KRL: looks down, turned left by 30 degrees
    left = Rotation.from_euler("z", 30, degrees=True).as_matrix() @ down
    assert zyx_angles_deg(left) == pytest.approx((30.0, 0.0, 180.0))


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.0, "0.000"), (-0.0004, "0.000"), (-0.0006, "-0.001"), (12.3456, "12.346")],
)
def test_numbers(value: float, text: str) -> None:
    assert fixed(value, 3) == text
