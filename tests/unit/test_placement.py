from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform
from boltpose.placement import PlacementConfig, place_bolt
from boltpose.schema import LocatedBolt, PriorBolt, Registration, Visibility
from tests.support import records
from tests.support.strategies import transforms


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
        config=PlacementConfig(bolt_tilt_sigma_rad=0.0),
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
