from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import KDTree

from boltpose.errors import ConfigError, EmptyScanError
from boltpose.prior.build import build_prior
from boltpose.schema import Scan
from boltpose.segmentation.full_scan import label_full_scan
from boltpose.segmentation.models import load_models
from boltpose.segmentation.predictor import PartProbabilities
from boltpose.segmentation.thinning import thin_scan
from tests.support.toy_motor import toy_motor

TOY = toy_motor(density=0.3)


class Slices:
    """A stand-in for the networks: classes by height, and what it was shown."""

    def __init__(self) -> None:
        self.points = np.zeros((0, 3))

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        self.points = np.asarray(points_prior)
        assert np.asarray(normals).shape == self.points.shape
        share = np.clip((self.points[:, 2] + 66) / 152, 0, 0.999)
        rows = np.full((len(share), 6), 0.02, dtype=np.float32)
        rows[np.arange(len(share)), (share * 6).astype(int)] = 0.9
        return PartProbabilities(probabilities=rows)


class Truth:
    """A stand-in that knows the toy; a few answers are wrong, so that they can be recognised."""

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        points = np.asarray(points_prior)
        _, nearest = KDTree(TOY.points).query(points)
        labels = TOY.labels[nearest].astype(int)
        labels[points[:, 0] > 37] = 3
        return PartProbabilities(probabilities=np.eye(6, dtype=np.float32)[labels - 1])


def test_label_says_of_every_point_what_a_prior_says_of_it() -> None:
    prior = build_prior(Scan(points=TOY.points), Truth(), name="toy")
    labels = label_full_scan(TOY.points, Truth()).labels
    np.testing.assert_array_equal(labels[thin_scan(TOY.points)], prior.labels)
    assert (labels != TOY.labels).any()


def test_a_dense_scan_is_shown_thinned_and_answered_point_by_point() -> None:
    rng = np.random.default_rng(0)
    dense = np.repeat(TOY.points, 8, axis=0) + rng.normal(scale=0.05, size=(8 * len(TOY.points), 3))
    order = rng.permutation(len(dense))
    stand_in = Slices()

    answer = label_full_scan(dense[order], stand_in)

    assert len(stand_in.points) < len(dense) / 4
    assert answer.probabilities.shape == (len(dense), 6)
    # what is well inside a slice has its class, in the order of the points
    share = np.clip((dense[order][:, 2] + 66) / 152, 0, 0.999) * 6
    inside = np.abs(share - np.rint(share)) > 0.1
    assert inside.mean() > 0.6
    np.testing.assert_array_equal(answer.labels[inside], share[inside].astype(int) + 1)


def test_strays_are_not_shown_but_answered() -> None:
    far = np.array([[400.0, 0.0, 70.0], [0.0, 900.0, -60.0]])
    stand_in = Slices()
    answer = label_full_scan(np.concatenate([far, TOY.points]), stand_in)
    assert np.abs(stand_in.points).max() < 200
    assert len(answer.labels) == len(TOY.points) + 2


def test_the_shipped_networks_answer_point_by_point_whatever_the_order() -> None:
    networks = load_models()
    order = np.random.default_rng(0).permutation(len(TOY.points))
    straight = label_full_scan(TOY.points, networks.parts).probabilities
    mixed = label_full_scan(TOY.points[order], networks.parts).probabilities
    np.testing.assert_allclose(mixed, straight[order], atol=2e-3)


def test_too_few_points_are_refused() -> None:
    with pytest.raises(EmptyScanError, match=r"a\.ply: found 300 points .* at least 5000"):
        label_full_scan(TOY.points[:300], Slices(), source="a.ply")


@pytest.mark.parametrize("setting", ["spacing_mm", "stray_ratio"])
def test_settings_of_thinning_are_checked(setting: str) -> None:
    with pytest.raises(ConfigError, match=f"{setting} must be > 0, got nan"):
        thin_scan(TOY.points, **{setting: float("nan")})
