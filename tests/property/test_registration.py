"""Laws of registration that hold for any pose."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from boltpose.geometry.transforms import Transform
from boltpose.registration.register import register
from boltpose.registration.rigid_fit import fit_rigid
from tests.support.strategies import transforms
from tests.unit.registration.scenes import pose_error, prepared_motor, visible_points


@settings(max_examples=6, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_orientation_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = Transform.from_parts(
        "camera",
        "prior",
        Rotation.random(rng=rng).as_matrix(),
        (rng.uniform(-80, 80), rng.uniform(-80, 80), rng.uniform(450, 900)),
    )

    best = register(prepared_motor(), visible_points(truth, seed=seed % 1000)).best

    assert best is not None
    assert pose_error(best.camera_from_prior, truth) < 0.1


@settings(max_examples=3, deadline=None, derandomize=True)
@given(angle=st.floats(-0.5, 0.5))
def test_turning_the_scan_about_the_camera_turns_the_pose(angle: float) -> None:
    truth = Transform.from_parts(
        "camera", "prior", Rotation.from_rotvec((0.4, 1.9, 0.3)).as_matrix(), (12, -7, 600)
    )
    points = visible_points(truth)
    turn = Transform.from_parts(
        "camera", "camera", Rotation.from_rotvec((0, 0, angle)).as_matrix(), (0, 0, 0)
    )

    straight = register(prepared_motor(), points).best
    turned = register(prepared_motor(), turn.apply(points)).best

    assert straight is not None
    assert turned is not None
    assert pose_error(turned.camera_from_prior, turn @ straight.camera_from_prior) < 0.05


@given(truth=transforms(), seed=st.integers(0, 2**32 - 1), count=st.integers(3, 40))
def test_fit_recovers_the_motion_that_made_the_pairs(
    truth: Transform, seed: int, count: int
) -> None:
    points = np.random.default_rng(seed).uniform(-100, 100, size=(count, 3))

    found = fit_rigid(points, truth.apply(points))

    np.testing.assert_allclose(found, truth.matrix, atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1))
def test_fit_never_mirrors(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-100, 100, size=(10, 3))

    found = fit_rigid(points, points * (-1.0, 1.0, 1.0))

    assert np.linalg.det(found[:3, :3]) > 0
