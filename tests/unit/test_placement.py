from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform
from boltpose.placement import PlacementConfig, place_bolt
from boltpose.schema import HandEyeError, LocatedBolt, PriorBolt, Registration, Visibility
from boltpose.tool_fit import ToolTolerance
from tests.support import records
from tests.support.strategies import transforms

EXACT = PlacementConfig(bolt_tilt_sigma_rad=0.0, sure_lateral_share=1.0, sure_axial_share=1.0)


def place(
    bolt: PriorBolt, registration: Registration, base_from_camera: Transform | None
) -> LocatedBolt:
    return place_bolt(
        bolt,
        registration,
        base_from_camera,
        visible_fraction=0.0,
        visibility=Visibility.HIDDEN,
        alignment_sigma_rad=0.0,
        config=EXACT,
    )


@given(transforms("base", "camera"), transforms("camera", "prior"))
def test_the_pose_is_the_chain_of_the_three(
    base_from_camera: Transform, camera_from_prior: Transform
) -> None:
    bolt = records.prior_bolt()
    placed = place(bolt, records.registration(camera_from_prior), base_from_camera)

    expected = base_from_camera.apply(camera_from_prior.apply(bolt.prior_from_bolt.translation_mm))
    np.testing.assert_allclose(placed.head_top, expected, atol=1e-9)
    assert placed.frame_from_bolt.target == "base"
    centre = base_from_camera.apply(camera_from_prior.apply(bolt.cluster_centre))
    np.testing.assert_allclose(placed.cluster_centre, centre, atol=1e-9)


@settings(max_examples=10, deadline=None)
@given(transforms("camera", "prior", reach_mm=50.0))
def test_sigmas_are_those_of_sampled_motions(camera_from_prior: Transform) -> None:
    bolt = records.prior_bolt()
    registration = records.registration(camera_from_prior)
    placed = place(bolt, registration, None)

    rng = np.random.default_rng(0)
    motions = rng.multivariate_normal(np.zeros(6), registration.covariance, 40000)
    own = rng.normal(size=(40000, 3)) * (
        bolt.sigma_lateral_mm,
        bolt.sigma_lateral_mm,
        bolt.sigma_axial_mm,
    )
    head = placed.head_top + own @ placed.frame_from_bolt.rotation.T - registration.centre_mm
    moved = Rotation.from_rotvec(motions[:, :3]).apply(head) + motions[:, 3:]
    local = (moved - moved.mean(axis=0)) @ placed.frame_from_bolt.rotation
    assert placed.sigma_axial_mm == pytest.approx(local[:, 2].std(), rel=0.03)
    widest = np.linalg.eigvalsh(np.cov(local[:, :2].T))[-1] ** 0.5
    assert placed.sigma_lateral_mm == pytest.approx(widest, rel=0.03)
    axes = Rotation.from_rotvec(motions[:, :3]).apply(placed.axis.copy())
    tilt = np.linalg.eigvalsh(np.cov(axes.T))[-1] ** 0.5
    assert placed.sigma_axis_rad == pytest.approx(tilt, rel=0.03)


def test_without_hand_eye_the_frame_is_the_camera() -> None:
    registration = records.registration(Transform.identity("camera", "prior"))
    assert place(records.prior_bolt(), registration, None).frame_from_bolt.target == "camera"


def test_an_inverted_hand_eye_is_refused() -> None:
    registration = records.registration(Transform.identity("camera", "prior"))
    with pytest.raises(FrameError, match="cannot chain camera_from_base @ camera_from_bolt"):
        place(records.prior_bolt(), registration, Transform.identity("camera", "base"))


@settings(max_examples=5, deadline=None)
@given(transforms("base", "camera"))
def test_an_uncertain_hand_eye_counts_as_sampled_ones_do(base_from_camera: Transform) -> None:
    camera_from_prior = Transform.from_parts("camera", "prior", np.eye(3), (40.0, -20.0, 650.0))
    bolt = records.prior_bolt()
    registration = records.registration(camera_from_prior)
    error = HandEyeError(rotation_sigma_rad=np.radians(0.05), translation_sigma_mm=0.3)

    def located(hand_eye_error: HandEyeError | None) -> LocatedBolt:
        return place_bolt(
            bolt,
            registration,
            base_from_camera,
            visible_fraction=0.0,
            visibility=Visibility.HIDDEN,
            alignment_sigma_rad=0.0,
            config=EXACT,
            hand_eye_error=hand_eye_error,
        )

    exact, uncertain = located(None), located(error)
    rng = np.random.default_rng(0)
    turns = Rotation.from_rotvec(rng.normal(scale=error.rotation_sigma_rad, size=(40000, 3)))
    shifts = rng.normal(scale=error.translation_sigma_mm, size=(40000, 3))
    in_camera = (camera_from_prior @ bolt.prior_from_bolt).translation_mm
    true_tops = base_from_camera.apply(turns.apply(in_camera.copy()) + shifts)
    own = np.linalg.cholesky(exact.covariance_mm2)
    offset = true_tops + rng.normal(size=(40000, 3)) @ own.T - uncertain.head_top
    squared = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(uncertain.covariance_mm2), offset)
    assert np.mean(squared < 7.815) == pytest.approx(0.95, abs=0.01)  # chi2 of 3, 95 %
    assert uncertain.sigma_axis_rad == pytest.approx(
        np.hypot(exact.sigma_axis_rad, error.rotation_sigma_rad)
    )
    assert uncertain.sigma_lateral_mm > exact.sigma_lateral_mm


def test_the_tool_fits_at_most_as_surely_as_the_bolt_is_one() -> None:
    bolt = records.prior_bolt()
    pose = Transform.from_parts("camera", "prior", np.eye(3), (0.0, 0.0, 700.0))

    def fit(tool: ToolTolerance | None) -> float | None:
        return place_bolt(
            bolt,
            records.registration(pose),
            None,
            visible_fraction=0.0,
            visibility=Visibility.HIDDEN,
            alignment_sigma_rad=0.0,
            config=PlacementConfig(),
            tool=tool,
        ).p_tool_fits

    assert fit(None) is None
    loose, tight = fit(ToolTolerance(lateral_mm=50.0)), fit(ToolTolerance(lateral_mm=0.01))
    assert loose is not None
    assert tight is not None
    assert loose == pytest.approx(bolt.confidence)
    assert tight < 0.1 * loose


def test_a_sure_bolt_is_better_known_than_its_prior_dares_to_say() -> None:
    still = Transform.from_parts("camera", "prior", np.eye(3), (0.0, 0.0, 700.0))
    exact = replace(records.registration(still), covariance=np.zeros((6, 6)))

    def placed(*, is_sure: bool) -> LocatedBolt:
        bolt = replace(records.prior_bolt(), is_sure=is_sure)
        return place_bolt(
            bolt,
            exact,
            None,
            visible_fraction=0.0,
            visibility=Visibility.HIDDEN,
            alignment_sigma_rad=0.0,
            config=PlacementConfig(),
        )

    sure, unsure = placed(is_sure=True), placed(is_sure=False)
    assert unsure.sigma_lateral_mm == pytest.approx(records.prior_bolt().sigma_lateral_mm)
    assert sure.sigma_lateral_mm == pytest.approx(0.5 * unsure.sigma_lateral_mm)
    assert sure.sigma_axial_mm == pytest.approx(0.65 * unsure.sigma_axial_mm)
