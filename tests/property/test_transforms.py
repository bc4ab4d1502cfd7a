"""The group axioms of `Transform`, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform, angle_between_rad, rotation_angle_rad
from tests.support.strategies import transforms

POINTS = np.random.default_rng(0).uniform(-300, 300, (20, 3))


@given(transforms("a", "b"), transforms("b", "c"), transforms("c", "d"))
def test_chaining_is_associative(ab: Transform, bc: Transform, cd: Transform) -> None:
    left = (ab @ bc) @ cd
    right = ab @ (bc @ cd)
    assert (left.target, left.source) == (right.target, right.source) == ("a", "d")
    np.testing.assert_allclose(left.matrix, right.matrix, atol=1e-9)


@given(transforms("a", "b"))
def test_inverse_undoes(ab: Transform) -> None:
    np.testing.assert_allclose(ab.inverse().apply(ab.apply(POINTS)), POINTS, atol=1e-9)
    np.testing.assert_allclose((ab @ ab.inverse()).matrix, np.eye(4), atol=1e-9)
    assert (ab.inverse().target, ab.inverse().source) == ("b", "a")


@given(transforms("a", "b"), transforms("b", "c"))
def test_chaining_equals_applying_in_turn(ab: Transform, bc: Transform) -> None:
    np.testing.assert_allclose((ab @ bc).apply(POINTS), ab.apply(bc.apply(POINTS)), atol=1e-9)


@given(transforms())
def test_distances_and_handedness_are_kept(camera_from_prior: Transform) -> None:
    moved = camera_from_prior.apply(POINTS)
    np.testing.assert_allclose(
        np.linalg.norm(moved[1:] - moved[:-1], axis=1),
        np.linalg.norm(POINTS[1:] - POINTS[:-1], axis=1),
        atol=1e-9,
    )
    assert np.linalg.det(camera_from_prior.rotation) == pytest.approx(1.0)


@given(transforms())
def test_six_decimals_cost_no_orthogonality(camera_from_prior: Transform) -> None:
    again = Transform("camera", "prior", camera_from_prior.matrix.round(6))
    np.testing.assert_allclose(again.rotation @ again.rotation.T, np.eye(3), atol=1e-14)


@given(transforms())
def test_quaternion_is_scalar_first(camera_from_prior: Transform) -> None:
    w, x, y, z = camera_from_prior.quaternion_wxyz
    np.testing.assert_allclose(
        Rotation.from_quat([x, y, z, w]).as_matrix(), camera_from_prior.rotation, atol=1e-12
    )
    assert w >= 0


@given(st.floats(1e-12, np.pi - 1e-6))
def test_angles_are_exact_down_to_nothing(angle_rad: float) -> None:
    turned = np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])
    assert float(angle_between_rad([1, 0, 0], turned)) == pytest.approx(angle_rad, rel=1e-9)
    matrix = Rotation.from_rotvec([0, 0, angle_rad]).as_matrix()
    assert rotation_angle_rad(matrix) == pytest.approx(angle_rad, rel=1e-6)


def test_wrong_chains_are_refused() -> None:
    camera_from_prior = Transform.identity("camera", "prior")
    with pytest.raises(
        FrameError, match="cannot chain camera_from_prior @ base_from_camera: 'prior' is not 'base'"
    ):
        _ = camera_from_prior @ Transform.identity("base", "camera")


@pytest.mark.parametrize(
    ("matrix", "text"),
    [
        (np.eye(3), "shape"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), "no rigid motion"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "mirrors"),
        (np.full((4, 4), np.nan), "finite"),
        (np.eye(4) + np.eye(4)[[3, 0, 1, 2]] * 0.1, "last row"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(matrix: np.ndarray, text: str) -> None:
    with pytest.raises(FrameError, match=text):
        Transform("base", "camera", matrix)


def test_the_matrix_cannot_be_changed() -> None:
    matrix = np.eye(4)
    transform = Transform("base", "camera", matrix)
    matrix[0, 3] = 5.0
    assert transform.translation_mm[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        transform.matrix[0, 3] = 5.0


@given(transforms("a", "b"), transforms("b", "c"))
def test_making_it_again_from_its_matrix_keeps_every_bit(ab: Transform, bc: Transform) -> None:
    chained = ab @ bc
    np.testing.assert_array_equal(Transform("a", "c", chained.matrix).matrix, chained.matrix)
