"""The shipped networks on (simulated) scans of reman18, which they were trained on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.datasets.labelled_motors import LabelledCloud
from boltpose.datasets.part_clouds import scan_normals
from boltpose.datasets.reman18 import Reman18
from boltpose.errors import DegenerateGeometryError, ShapeError
from boltpose.schema import Part
from boltpose.segmentation.models import load_models
from boltpose.segmentation.predictor import PARTS, PartProbabilities
from boltpose.segmentation.voting import VotingConfig, split_randomly

DATA = Reman18(root=Path(__file__).parents[3] / "data" / "reman18")
MODELS = load_models()


@pytest.fixture(scope="module")
def scan() -> tuple[LabelledCloud, np.ndarray, PartProbabilities]:
    whole = DATA.full_scan("motor_012")
    some = LabelledCloud(points=whole.points[::3], labels=whole.labels[::3])
    normals = scan_normals(some.points)
    return some, normals, MODELS.parts.predict(some.points, normals)


@pytest.fixture(scope="module")
def view() -> LabelledCloud:
    whole = DATA.view("motor_012", 1)
    return LabelledCloud(points=whole.points[::3], labels=whole.labels[::3])


def test_parts_of_a_thinned_scan_are_found(
    scan: tuple[LabelledCloud, np.ndarray, PartProbabilities],
) -> None:
    cloud, _, found = scan
    assert found.probabilities.dtype == np.float32
    np.testing.assert_allclose(found.probabilities.sum(axis=1), 1.0, atol=1e-4)
    assert (found.labels == cloud.labels).mean() > 0.9
    bolt = cloud.labels == Part.BOLT
    assert np.median(found.of(Part.BOLT)[bolt]) > 0.5
    assert np.median(found.of(Part.BOLT)[~bolt]) < 0.05
    assert found.frame is not None
    assert found.frame.has_second_cylinder


def test_permuted_points_get_permuted_labels_bit_by_bit(
    scan: tuple[LabelledCloud, np.ndarray, PartProbabilities],
) -> None:
    cloud, normals, found = scan
    order = np.random.default_rng(0).permutation(len(cloud.points))
    again = MODELS.parts.predict(cloud.points[order], normals[order])
    np.testing.assert_array_equal(again.probabilities, found.probabilities[order])


def test_a_moved_motor_gets_the_same_labels(
    scan: tuple[LabelledCloud, np.ndarray, PartProbabilities],
) -> None:
    cloud, normals, found = scan
    turn = Rotation.random(rng=np.random.default_rng(3)).as_matrix()
    moved = MODELS.parts.predict(cloud.points @ turn.T + (50.0, -20.0, 400.0), normals @ turn.T)
    assert (moved.labels == found.labels).mean() > 0.97


def test_scans_that_are_no_motor_are_refused() -> None:
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(3000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    with pytest.raises(DegenerateGeometryError):
        MODELS.parts.predict(ball * 60, ball)
    with pytest.raises(ShapeError, match="at least 100 rows"):
        MODELS.parts.predict(ball[:50], ball[:50])
    with pytest.raises(ShapeError, match="normals must have shape"):
        MODELS.parts.predict(ball, ball[:-1])


def test_the_motor_of_a_view_is_found_the_same_every_time(view: LabelledCloud) -> None:
    found = MODELS.scene.predict(view.points)
    motor = view.labels != Part.BACKGROUND
    guess = found > 0.5
    assert found.shape == motor.shape
    assert (guess & motor).sum() / (guess | motor).sum() > 0.85
    np.testing.assert_array_equal(MODELS.scene.predict(view.points), found)


@pytest.mark.parametrize("count", [3, 40])
def test_a_handful_of_points_is_answered(count: int) -> None:
    points = np.random.default_rng(0).uniform(0, 100, (count, 3)) + (0, 0, 700)
    found = MODELS.scene.predict(points)
    assert found.shape == (count,)
    assert ((found >= 0) & (found <= 1)).all()


def test_columns_follow_the_part_numbers() -> None:
    assert [int(part) for part in PARTS] == [1, 2, 3, 4, 5, 6]
    one = PartProbabilities(probabilities=np.eye(6, dtype=np.float32))
    assert one.labels.tolist() == [1, 2, 3, 4, 5, 6]
    assert one.of(Part.GEAR).tolist() == [0, 0, 0, 0, 1, 0]


@pytest.mark.parametrize(("count", "size"), [(1, 10), (100, 7), (5000, 2048)])
def test_groups_share_every_point_out_once(count: int, size: int) -> None:
    groups = split_randomly(count, size, np.random.default_rng(0))
    assert np.array_equal(np.sort(np.concatenate(groups)), np.arange(count))
    assert max(map(len, groups)) - min(map(len, groups)) <= 1


def test_there_must_be_a_vote() -> None:
    with pytest.raises(ValueError, match="passes"):
        VotingConfig(passes=0)
