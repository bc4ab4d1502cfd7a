"""Plain networks on the demo motor; the network is a matrix, so every answer is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.special import softmax

import boltpose
from boltpose.datasets.part_clouds import scan_normals
from boltpose.errors import ConfigError, DegenerateGeometryError, InputFileError, ShapeError
from boltpose.io.scan import read_scan
from boltpose.segmentation.part_features import compute_part_features
from boltpose.segmentation.plain import (
    INPUTS,
    PARTS_PLAIN,
    SCENE_PLAIN,
    PlainPartPredictor,
    PlainScenePredictor,
    describe_scan,
    input_columns,
)
from boltpose.segmentation.scene_features import compute_scene_features
from boltpose.segmentation.voting import VotingConfig
from tests.support.onnx_files import write_linear_network

DEMO = Path(boltpose.__file__).parent / "demo"


@pytest.fixture(scope="module")
def scan() -> tuple[np.ndarray, np.ndarray]:
    points = read_scan(DEMO / "full_scan.ply").points[::12]
    return points, scan_normals(points)


@pytest.fixture(scope="module")
def view() -> np.ndarray:
    return read_scan(DEMO / "000002.png", camera=DEMO / "scene_camera.json").points[::10]


def _weight(task: str, inputs: str) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.normal(size=(len(input_columns(task, inputs)), 6 if task == "parts" else 2)) / 3


@pytest.mark.parametrize("inputs", INPUTS)
def test_parts_are_those_of_the_network_on_its_columns(
    scan: tuple[np.ndarray, np.ndarray], tmp_path: Path, inputs: str
) -> None:
    points, normals = scan
    path = tmp_path / "parts.onnx"
    weight = write_linear_network(path, PARTS_PLAIN, _weight("parts", inputs), {"inputs": inputs})
    found = PlainPartPredictor(path, VotingConfig(passes=2)).predict(points, normals)

    order = np.lexsort(points.T)
    described = compute_part_features(points[order], normals[order])
    columns = described.features[:, input_columns("parts", inputs)]
    np.testing.assert_allclose(
        found.probabilities[order], softmax(columns @ weight, axis=1), atol=1e-5
    )
    assert found.frame is not None
    assert found.frame.has_second_cylinder


def test_what_is_computed_alone_is_what_the_features_hold(
    scan: tuple[np.ndarray, np.ndarray],
) -> None:
    points, normals = scan
    features = compute_part_features(points, normals).features
    for inputs in INPUTS:
        rows = describe_scan(points, normals, inputs)[1]
        assert rows.dtype == np.float32
        np.testing.assert_array_equal(rows, features[:, input_columns("parts", inputs)])
    np.testing.assert_allclose(
        np.linalg.norm(describe_scan(points, normals, "features")[1][:, 3:6], axis=1), 1, atol=1e-5
    )


def test_permuted_points_get_permuted_parts_bit_by_bit(
    scan: tuple[np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    points, normals = scan
    path = tmp_path / "parts.onnx"
    write_linear_network(path, PARTS_PLAIN, _weight("parts", "normals"), {"inputs": "normals"})
    predictor = PlainPartPredictor(path)
    order = np.random.default_rng(0).permutation(len(points))
    np.testing.assert_array_equal(
        predictor.predict(points[order], normals[order]).probabilities,
        predictor.predict(points, normals).probabilities[order],
    )


@pytest.mark.parametrize("temperature", [0.5, 3.0])
def test_the_temperature_divides_the_scores(
    scan: tuple[np.ndarray, np.ndarray], tmp_path: Path, temperature: float
) -> None:
    points, normals = scan
    path = tmp_path / "parts.onnx"
    weight = write_linear_network(
        path,
        PARTS_PLAIN,
        _weight("parts", "xyz"),
        {"inputs": "xyz", "temperature": temperature},
    )
    found = PlainPartPredictor(path).predict(points, normals)
    order = np.lexsort(points.T)
    rows = describe_scan(points[order], normals[order], "xyz")[1]
    np.testing.assert_allclose(
        found.probabilities[order], softmax(rows @ weight / temperature, axis=1), atol=1e-5
    )


@pytest.mark.parametrize("inputs", INPUTS)
def test_the_motor_of_a_view_is_that_of_the_network(
    view: np.ndarray, tmp_path: Path, inputs: str
) -> None:
    path = tmp_path / "scene.onnx"
    weight = write_linear_network(path, SCENE_PLAIN, _weight("scene", inputs), {"inputs": inputs})
    predictor = PlainScenePredictor(path)
    found = predictor.predict(view)

    order = np.lexsort(view.T)
    described = compute_scene_features(view[order])
    wanted = softmax(described.features[:, input_columns("scene", inputs)] @ weight, axis=1)[:, 1]
    np.testing.assert_allclose(found[order], wanted[described.voxel], atol=1e-5)
    shuffled = np.random.default_rng(0).permutation(len(view))
    np.testing.assert_array_equal(predictor.predict(view[shuffled]), found[shuffled])


@pytest.mark.parametrize("count", [3, 40])
def test_a_handful_of_points_is_answered(tmp_path: Path, count: int) -> None:
    path = tmp_path / "scene.onnx"
    write_linear_network(path, SCENE_PLAIN, _weight("scene", "xyz"), {"inputs": "xyz"})
    points = np.random.default_rng(0).uniform(0, 100, (count, 3)) + (0, 0, 700)
    found = PlainScenePredictor(path).predict(points)
    assert found.shape == (count,)
    assert ((found > 0) & (found < 1)).all()


def test_scans_that_are_no_motor_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "parts.onnx"
    write_linear_network(path, PARTS_PLAIN, _weight("parts", "xyz"), {"inputs": "xyz"})
    predictor = PlainPartPredictor(path)
    ball = np.random.default_rng(0).normal(size=(3000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    with pytest.raises(DegenerateGeometryError):
        predictor.predict(60 * ball, ball)
    with pytest.raises(ShapeError, match="at least 100 rows"):
        predictor.predict(ball[:50], ball[:50])
    with pytest.raises(ShapeError, match="normals must have shape"):
        predictor.predict(ball, ball[:-1])


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({}, "found inputs = None, wanted xyz or normals or features"),
        ({"inputs": "colours"}, "found inputs = colours"),
        ({"inputs": "normals"}, "found columns = 3, wanted columns = 6"),
        ({"inputs": "xyz", "sub_cloud": "many"}, "found sub_cloud = many"),
        ({"inputs": "xyz", "sub_cloud": 0}, "found sub_cloud = 0"),
    ],
)
def test_settings_that_do_not_fit_are_told(
    tmp_path: Path, settings: dict[str, object], text: str
) -> None:
    path = tmp_path / "scene.onnx"
    write_linear_network(path, SCENE_PLAIN, np.ones((3, 2)), settings)
    with pytest.raises(InputFileError, match=text):
        PlainScenePredictor(path).predict(np.ones((10, 3)))


def test_a_network_with_other_classes_is_told(tmp_path: Path) -> None:
    path = tmp_path / "scene.onnx"
    write_linear_network(path, SCENE_PLAIN, np.ones((3, 6)), {"inputs": "xyz"})
    with pytest.raises(InputFileError, match=r"scene\.onnx: found 6 classes, wanted 2"):
        PlainScenePredictor(path).predict(np.ones((10, 3)))


def test_unknown_inputs_are_refused() -> None:
    with pytest.raises(ConfigError, match="task must be one of"):
        input_columns("motors", "xyz")
    with pytest.raises(ConfigError, match="inputs must be one of"):
        input_columns("parts", "colours")
