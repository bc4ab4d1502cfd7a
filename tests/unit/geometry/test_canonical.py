from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import DegenerateGeometryError, ShapeError
from boltpose.geometry.canonical import CanonicalConfig, find_canonical_frame
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from tests.support.toy_motor import toy_motor


def _random_motion(seed: int) -> Transform:
    rng = np.random.default_rng(seed)
    return Transform.from_parts(
        "prior", "toy", Rotation.random(rng=rng).as_matrix(), rng.uniform(-300, 300, 3)
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_frame_moves_with_the_motor(seed: int) -> None:
    motor = toy_motor(seed=seed)
    prior_from_toy = _random_motion(seed)

    frame = find_canonical_frame(
        prior_from_toy.apply(motor.points), prior_from_toy.rotate(motor.normals)
    )

    canonical_from_toy = frame.canonical_from_prior @ prior_from_toy
    assert frame.has_second_cylinder
    assert np.degrees(rotation_angle_rad(canonical_from_toy.rotation)) < 0.2
    # the toy's z = 0 is not half way along its axis (-66 to 85): only x and y are fixed by it
    np.testing.assert_allclose(canonical_from_toy.translation_mm[:2], 0.0, atol=0.2)
    np.testing.assert_allclose(canonical_from_toy.translation_mm[2], -9.5, atol=0.5)
    assert frame.main_radius_mm == pytest.approx(38.0, abs=0.1)
    assert frame.second_radius_mm == pytest.approx(26.0, abs=0.1)
    assert frame.second_offset_mm == pytest.approx(68.0, abs=0.1)


def test_a_motor_without_a_solenoid_is_not_forced_into_the_frame() -> None:
    motor = toy_motor(with_solenoid=False)

    frame = find_canonical_frame(motor.points, motor.normals)

    assert not frame.has_second_cylinder
    assert frame.second_offset_mm == 0.0
    assert frame.second_radius_mm == 0.0
    assert frame.canonical_from_prior.rotation[2] == pytest.approx([0, 0, 1], abs=0.01)


def test_the_same_scan_gives_the_same_bits() -> None:
    motor = toy_motor()
    first = find_canonical_frame(motor.points, motor.normals, seed=5)
    second = find_canonical_frame(motor.points, motor.normals, seed=5)
    assert np.array_equal(first.canonical_from_prior.matrix, second.canonical_from_prior.matrix)


def test_a_ball_has_no_axis() -> None:
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(5000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    with pytest.raises(DegenerateGeometryError, match="share a perpendicular"):
        find_canonical_frame(normals * 40, normals)


def test_a_plane_has_no_axis() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-50, 50, (2000, 2)), np.zeros(2000)])
    with pytest.raises(DegenerateGeometryError, match="parallel"):
        find_canonical_frame(points, np.tile([0.0, 0.0, 1.0], (2000, 1)))


def test_a_motor_of_another_size_class_is_refused() -> None:
    motor = toy_motor()
    with pytest.raises(DegenerateGeometryError, match="no cylinder of radius"):
        find_canonical_frame(motor.points / 10, motor.normals)


def test_normals_must_belong_to_the_points() -> None:
    motor = toy_motor()
    with pytest.raises(ShapeError, match="normals must have shape"):
        find_canonical_frame(motor.points, motor.normals[:-1])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("voxel_mm", float("nan")),
        ("axis_hypotheses", 0),
        ("main_radius_mm", (5.0, 4.0)),
        ("min_second_share", 1.0),
    ],
)
def test_settings_are_checked(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        CanonicalConfig(**{name: value})  # pyright: ignore[reportArgumentType]
