"""The motor's axes belong to the motor: they move with the scan and ignore the points' order."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.geometry.transforms import Transform, angle_between_rad
from boltpose.prior.alignment import align_motor, bolt_rotation
from boltpose.schema import Side
from tests.support.strategies import transforms
from tests.support.toy_motor import toy_motor

MOTOR = toy_motor(density=0.12)
REFERENCE = align_motor(MOTOR.points, MOTOR.normals, MOTOR.labels)


def assert_same_frame(found: Transform, expected: Transform) -> None:
    for column in range(3):
        angle = angle_between_rad(found.rotation[:, column], expected.rotation[:, column])
        assert np.rad2deg(float(angle)) < 0.05
    np.testing.assert_allclose(found.translation_mm, expected.translation_mm, atol=0.05)


@settings(max_examples=8, deadline=None)
@given(moved_from_prior=transforms("moved", "prior"))
def test_axes_move_with_the_scan(moved_from_prior: Transform) -> None:
    found = align_motor(
        moved_from_prior.apply(MOTOR.points), moved_from_prior.rotate(MOTOR.normals), MOTOR.labels
    )
    moved_from_motor = moved_from_prior @ REFERENCE.prior_from_motor
    assert_same_frame(found.prior_from_motor, moved_from_motor)
    for side in Side:
        assert np.linalg.det(bolt_rotation(side, found)) > 0.999


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_axes_do_not_depend_on_the_order_of_points(seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(MOTOR.points))
    found = align_motor(MOTOR.points[order], MOTOR.normals[order], MOTOR.labels[order])
    assert_same_frame(found.prior_from_motor, REFERENCE.prior_from_motor)
