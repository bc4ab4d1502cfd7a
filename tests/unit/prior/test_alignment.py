from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, DegenerateGeometryError, ShapeError
from boltpose.geometry.transforms import angle_between_rad
from boltpose.prior.alignment import AlignmentConfig, align_motor, bolt_rotation
from boltpose.prior.housing_axis import HousingAxisConfig
from boltpose.schema import Part, Side
from tests.support.toy_motor import ToyMotor, toy_motor


def with_housing_normals(normals: FloatArray) -> ToyMotor:
    """The toy motor, its housing's normals replaced (repeated as often as needed)."""
    motor = toy_motor()
    housing = motor.labels == Part.MAIN_HOUSING
    replaced = motor.normals.copy()
    replaced[housing] = np.resize(normals, (int(housing.sum()), 3))
    return ToyMotor(points=motor.points, normals=replaced, labels=motor.labels)


def test_axes_of_a_motor_are_found() -> None:
    motor = toy_motor()
    alignment = align_motor(motor.points, motor.normals, motor.labels)
    frame = alignment.prior_from_motor
    assert alignment.has_solenoid
    assert np.rad2deg(angle_between_rad(frame.z_axis, [0, 0, 1])) < 0.05
    assert np.rad2deg(angle_between_rad(frame.rotation[:, 1], [0, 1, 0])) < 0.1
    np.testing.assert_allclose(frame.translation_mm[:2], 0.0, atol=0.05)
    # from the lower bolt heads at -66 to the pinion's end at 85
    assert frame.translation_mm[2] == pytest.approx((85 - 66) / 2, abs=0.5)


def test_sigma_of_the_axis_covers_its_error() -> None:
    motor = toy_motor(noise_mm=0.1)
    alignment = align_motor(motor.points, motor.normals, motor.labels)
    error = float(angle_between_rad(alignment.prior_from_motor.z_axis, [0, 0, 1]))
    assert error < 3.5 * alignment.axis_sigma_rad
    assert alignment.axis_sigma_rad < np.deg2rad(0.1)


def test_wrong_labels_and_dents_do_not_turn_the_axis() -> None:
    motor = toy_motor(seed=3)
    rng = np.random.default_rng(0)
    labels = motor.labels.copy()
    connector = np.flatnonzero(labels == Part.CONNECTOR)
    labels[rng.choice(connector, len(connector) // 4, replace=False)] = Part.MAIN_HOUSING
    labels[(labels == Part.SOLENOID) & (motor.points[:, 1] < 50)] = Part.MAIN_HOUSING
    points = motor.points.copy()
    dent = (motor.labels == Part.MAIN_HOUSING) & (np.linalg.norm(points - (38, 0, 10), axis=1) < 15)
    points[dent] -= 0.8 * motor.normals[dent]
    alignment = align_motor(points, motor.normals, labels)
    assert np.rad2deg(angle_between_rad(alignment.prior_from_motor.z_axis, [0, 0, 1])) < 0.1
    assert np.rad2deg(angle_between_rad(alignment.prior_from_motor.rotation[:, 1], [0, 1, 0])) < 0.3


def test_without_solenoid_the_roll_is_arbitrary_but_the_same_every_time() -> None:
    motor = toy_motor(with_solenoid=False)
    first = align_motor(motor.points, motor.normals, motor.labels)
    again = align_motor(motor.points, motor.normals, motor.labels)
    assert not first.has_solenoid
    np.testing.assert_array_equal(first.prior_from_motor.matrix, again.prior_from_motor.matrix)
    assert np.rad2deg(angle_between_rad(first.prior_from_motor.z_axis, [0, 0, 1])) < 0.05


def test_a_solenoid_on_the_axis_gives_no_direction() -> None:
    motor = toy_motor(with_solenoid=False)
    labels = motor.labels.copy()
    labels[labels == Part.GEAR] = Part.SOLENOID
    assert not align_motor(motor.points, motor.normals, labels).has_solenoid


def test_z_follows_the_connector() -> None:
    motor = toy_motor()
    flip = np.array([1.0, -1.0, -1.0])
    alignment = align_motor(motor.points * flip, motor.normals * flip, motor.labels)
    assert np.rad2deg(angle_between_rad(alignment.prior_from_motor.z_axis, [0, 0, -1])) < 0.05


@pytest.mark.parametrize(
    ("normals", "message"),
    [
        (Rotation.random(4000, rng=0).as_matrix()[:, 0], "lie in a common plane"),
        (np.array([[1.0, 0.0, 0.0]]), "parallel"),
        (np.eye(3), "two different axes"),
    ],
    ids=["sphere", "plate", "cube"],
)
def test_normals_that_do_not_determine_an_axis_are_refused(
    normals: FloatArray, message: str
) -> None:
    motor = with_housing_normals(normals)
    with pytest.raises(DegenerateGeometryError, match=message):
        align_motor(motor.points, motor.normals, motor.labels)


def test_a_noisy_plate_is_refused_too() -> None:
    rng = np.random.default_rng(1)
    normals = np.array([1.0, 0.0, 0.0]) + rng.normal(scale=0.05, size=(4000, 3))
    motor = with_housing_normals(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    with pytest.raises(DegenerateGeometryError, match="do not determine"):
        align_motor(motor.points, motor.normals, motor.labels)


def test_too_few_housing_points_are_refused() -> None:
    motor = toy_motor()
    keep = np.flatnonzero(motor.labels != Part.MAIN_HOUSING)
    with pytest.raises(DegenerateGeometryError, match="0 points of the main housing"):
        align_motor(motor.points[keep], motor.normals[keep], motor.labels[keep])


def test_without_a_connector_the_sign_of_z_is_not_guessed() -> None:
    motor = toy_motor()
    labels = motor.labels.copy()
    labels[labels == Part.CONNECTOR] = Part.GEAR
    with pytest.raises(DegenerateGeometryError, match="sign of the motor's z axis"):
        align_motor(motor.points, motor.normals, labels)


def test_a_connector_around_the_housing_does_not_tell_the_sign() -> None:
    motor = toy_motor()
    labels = motor.labels.copy()
    connector = labels == Part.CONNECTOR
    labels[connector] = Part.GEAR
    rng = np.random.default_rng(0)
    housing = np.flatnonzero(labels == Part.MAIN_HOUSING)
    labels[rng.choice(housing, len(housing) // 3, replace=False)] = Part.CONNECTOR
    with pytest.raises(DegenerateGeometryError, match="sign of the motor's z axis"):
        align_motor(motor.points, motor.normals, labels)


def test_arrays_that_do_not_belong_together_are_refused() -> None:
    motor = toy_motor()
    with pytest.raises(ShapeError, match="one row per point"):
        align_motor(motor.points, motor.normals, motor.labels[:-1])


@pytest.mark.parametrize("side", list(Side))
def test_bolt_rotation_is_proper_and_looks_out_of_the_head(side: Side) -> None:
    motor = toy_motor()
    alignment = align_motor(motor.points, motor.normals, motor.labels)
    rotation = bolt_rotation(side, alignment)
    z = alignment.prior_from_motor.z_axis
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation[:, 2], z if side is Side.TOP else -z, atol=1e-12)
    np.testing.assert_allclose(
        rotation[:, 0], alignment.prior_from_motor.rotation[:, 0], atol=1e-12
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda: AlignmentConfig(min_part_points=5),
        lambda: AlignmentConfig(min_solenoid_offset=float("nan")),
        lambda: AlignmentConfig(solenoid_radius_range_mm=(5.0, 5.0)),
        lambda: HousingAxisConfig(plane_tolerance=0.0),
        lambda: HousingAxisConfig(radius_range_mm=(0.0, 5.0)),
        lambda: HousingAxisConfig(max_axis_sigma_rad=0.0),
        lambda: HousingAxisConfig(ransac_iterations=0),
    ],
)
def test_settings_out_of_range_are_refused(make) -> None:
    with pytest.raises(ConfigError):
        make()
