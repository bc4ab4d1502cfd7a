from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, EmptyScanError
from boltpose.geometry.canonical import CanonicalFrame
from boltpose.geometry.transforms import Transform, angle_between_rad
from boltpose.io.scan import read_scan
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import prior_to_json, read_prior, write_prior
from boltpose.schema import Scan
from boltpose.segmentation.predictor import PartProbabilities
from tests.support import reman18

MOTOR = "motor_011"
FILE_LABELS = BuildConfig(use_file_labels=True)


def full_scan() -> Scan:
    return read_scan(reman18.ROOT / MOTOR / "prior.ply")


def test_a_prior_from_disk_equals_the_one_in_memory(tmp_path: Path) -> None:
    prior = reman18.true_prior(MOTOR)
    write_prior(tmp_path / "m.prior.npz", prior)
    again = read_prior(tmp_path / "m.prior.npz")
    np.testing.assert_array_equal(again.points, prior.points)
    np.testing.assert_array_equal(again.normals, prior.normals)
    assert prior_to_json(again) == json.loads(json.dumps(prior_to_json(prior)))


def test_axes_and_bolts_follow_the_scan_wherever_it_lies() -> None:
    scan = full_scan()
    moved_from_prior = Transform.from_parts(
        "prior", "prior", Rotation.from_rotvec([1.0, 2.0, -0.5]).as_matrix(), (500.0, 0.0, -90.0)
    )
    turned = Scan(points=moved_from_prior.apply(scan.points), labels=scan.labels)
    prior = reman18.true_prior(MOTOR)

    again = build_prior(turned, config=FILE_LABELS, name="turned")

    assert [bolt.id for bolt in again.bolts] == [bolt.id for bolt in prior.bolts]
    for bolt, same in zip(prior.bolts, again.bolts, strict=True):
        expected = moved_from_prior @ bolt.prior_from_bolt
        gap = np.linalg.norm(expected.translation_mm - same.prior_from_bolt.translation_mm)
        assert gap < 0.2, bolt.id
        turn = angle_between_rad(expected.z_axis, same.prior_from_bolt.z_axis)
        assert np.degrees(turn) < 0.2
        assert np.linalg.det(same.prior_from_bolt.rotation) == pytest.approx(1.0)


def test_labels_in_a_file_do_not_slip_in_unnoticed() -> None:
    with pytest.raises(ConfigError, match="needs a part predictor, or labels and use_file_labels"):
        build_prior(full_scan(), name="m")
    with pytest.raises(ConfigError, match="the scan has no labels"):
        build_prior(Scan(points=full_scan().points), config=FILE_LABELS, name="m")


def test_too_few_points_are_refused_with_the_numbers() -> None:
    scan = full_scan().subset(np.arange(1000))
    with pytest.raises(EmptyScanError, match="found 1000 points after thinning, wanted at least"):
        build_prior(scan, config=FILE_LABELS, name="m")


def test_two_opinions_that_differ_leave_no_bolt_sure() -> None:
    class Tilted:
        """True labels, but a label-free frame that is 5 degrees off."""

        def predict(self, points: np.ndarray, normals: np.ndarray) -> PartProbabilities:
            one_hot = (prior.labels[:, None] == np.arange(1, 7)).astype(np.float32)
            tilt = Rotation.from_rotvec([np.radians(5.0), 0, 0]).as_matrix()
            motor_from_prior = prior.alignment.prior_from_motor.inverse()
            frame = CanonicalFrame(
                canonical_from_prior=Transform.from_parts(
                    "canonical", "prior", tilt @ motor_from_prior.rotation, (0, 0, 0)
                ),
                main_radius_mm=30.0,
                main_share=0.3,
                second_radius_mm=0.0,
                second_offset_mm=0.0,
                second_share=0.0,
                has_second_cylinder=False,
                axis_share=0.5,
                z_range_mm=(-50.0, 50.0),
                sign_margin_mm=10.0,
            )
            return PartProbabilities(probabilities=one_hot, frame=frame)

    prior = reman18.true_prior(MOTOR)
    scan = Scan(points=full_scan().points)
    doubted = build_prior(scan, Tilted(), name="m")
    assert doubted.bolts
    assert not any(bolt.is_sure for bolt in doubted.bolts)
    assert "differ by 5.0 deg" in doubted.bolts[0].remarks[-1]
    trusted = build_prior(
        scan, Tilted(), replace(BuildConfig(), max_axis_disagreement_rad=0.2), name="m"
    )
    assert any(bolt.is_sure for bolt in trusted.bolts)
