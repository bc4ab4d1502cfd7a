import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import FineConfig
from boltpose.registration.covariance import depth_bias_variance_mm2
from boltpose.registration.icp import assess_pose, refine_pose
from boltpose.registration.rigid_fit import fit_rigid
from tests.unit.registration.scenes import pose, pose_error, prepared_motor, visible_points

TRUTH = pose(turn=(0.4, 1.9, 0.3))
CONFIG = FineConfig()


def moved(truth: Transform, turn_rad: tuple, shift_mm: tuple) -> Transform:
    inner = Transform.from_parts(
        "prior", "prior", Rotation.from_rotvec(turn_rad).as_matrix(), shift_mm
    )
    return truth @ inner


@pytest.mark.parametrize(
    ("turn", "shift"),
    [((0, 0, 0), (0, 0, 0)), ((0.01, -0.01, 0.01), (0.5, 0.5, -0.5)), ((0, 0, -0.02), (1, 0, 1))],
)
def test_a_start_near_the_truth_ends_at_the_truth(turn: tuple, shift: tuple) -> None:
    result = refine_pose(moved(TRUTH, turn, shift), visible_points(TRUTH), prepared_motor(), CONFIG)

    assert result.converged
    assert pose_error(result.camera_from_prior, TRUTH) < 0.05
    assert result.rms_mm < 0.06
    assert result.inlier_ratio > 0.9


def test_foreign_points_near_the_surface_do_not_pull() -> None:
    points = visible_points(TRUTH)
    lifted = points[::10] * (1 - 0.8 / np.linalg.norm(points[::10], axis=1))[:, None]

    result = refine_pose(TRUTH, np.vstack([points, lifted]), prepared_motor(), CONFIG)

    assert pose_error(result.camera_from_prior, TRUTH) < 0.08


def test_the_covariance_is_symmetric_positive_and_never_below_the_floor() -> None:
    result = refine_pose(TRUTH, visible_points(TRUTH), prepared_motor(), CONFIG)

    np.testing.assert_array_equal(result.covariance, result.covariance.T)
    assert np.linalg.eigvalsh(result.covariance)[0] > 0
    view = result.centre_mm / np.linalg.norm(result.centre_mm)
    along = view @ result.covariance[3:, 3:] @ view
    assert along >= depth_bias_variance_mm2(result.centre_mm, CONFIG)
    assert np.diag(result.covariance)[:3].min() >= CONFIG.rotation_sigma_rad**2
    np.testing.assert_allclose(result.centre_mm, TRUTH.apply(prepared_motor().centre_mm), atol=0.1)


def test_a_view_of_the_bare_cylinder_leaves_its_roll_and_slide_uncertain() -> None:
    truth = pose(turn=(np.pi / 2, 0.0, 0.0))
    points = visible_points(truth)
    in_prior = truth.inverse().apply(points)
    on_housing = np.abs(np.hypot(in_prior[:, 0], in_prior[:, 1]) - 30.0) < 0.3
    in_the_middle = np.abs(in_prior[:, 2]) < 15.0

    full = assess_pose(truth, points, prepared_motor(), CONFIG, converged=True, iterations=0)
    bare = assess_pose(
        truth,
        points[on_housing & in_the_middle],
        prepared_motor(),
        CONFIG,
        converged=True,
        iterations=0,
    )

    axis = truth.rotate([0.0, 0.0, 1.0])
    for block in (slice(0, 3), slice(3, 6)):
        sure = axis @ full.covariance[block, block] @ axis
        unsure = axis @ bare.covariance[block, block] @ axis
        assert unsure > 25 * sure


def test_points_far_from_the_prior_are_refused() -> None:
    points = visible_points(TRUTH) + np.array([0.0, 300.0, 0.0])
    with pytest.raises(DegenerateGeometryError, match=r"lie within 3\.0 mm of the posed prior"):
        refine_pose(TRUTH, points, prepared_motor(), CONFIG)


def test_same_input_same_bits() -> None:
    points = visible_points(TRUTH)
    first = refine_pose(TRUTH, points, prepared_motor(), CONFIG)
    second = refine_pose(TRUTH, points, prepared_motor(), CONFIG)

    np.testing.assert_array_equal(first.camera_from_prior.matrix, second.camera_from_prior.matrix)
    np.testing.assert_array_equal(first.covariance, second.covariance)


def test_pairs_on_a_line_determine_no_rotation() -> None:
    line = np.outer(np.arange(5.0), (1, 2, 3))
    with pytest.raises(DegenerateGeometryError, match="5 pairs lie on one line"):
        fit_rigid(line, line)
