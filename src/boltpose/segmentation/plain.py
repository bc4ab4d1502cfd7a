"""Networks of one stage, on sub-clouds as in the paper, behind the same protocols."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, FloatArray, as_points
from boltpose.errors import ConfigError, InputFileError
from boltpose.geometry.canonical import CanonicalFrame, find_canonical_frame
from boltpose.segmentation.onnx_session import OnnxNetwork
from boltpose.segmentation.part_features import FEATURE_WIDTH, compute_part_features
from boltpose.segmentation.predictor import PARTS, PartProbabilities, as_full_scan
from boltpose.segmentation.scene_features import SCENE_WIDTH, compute_scene_features
from boltpose.segmentation.voting import VotingConfig, temper, vote

PARTS_PLAIN: Final = "parts_plain"
SCENE_PLAIN: Final = "scene_plain"
"""Kinds of networks, see `OnnxNetwork`."""

TASKS: Final = ("parts", "scene")
INPUTS: Final = ("xyz", "normals", "features")
CLASSES: Final = {"parts": len(PARTS), "scene": 2}

LEAST_POINTS: Final = 64
"""Clouds with fewer points are filled up with their own: networks look at up to 32 neighbours."""

_COLUMNS: dict[tuple[str, str], list[int]] = {
    ("parts", "xyz"): [0, 1, 2],
    ("parts", "normals"): [0, 1, 2, 4, 5, 6],
    ("parts", "features"): [0, 1, 2, 4, 5, 6, 3, *range(7, FEATURE_WIDTH)],
    ("scene", "xyz"): [0, 1, 2],
    ("scene", "normals"): [0, 1, 2, 3, 4, 5],
    ("scene", "features"): list(range(SCENE_WIDTH)),
}


def input_columns(task: str, inputs: str) -> list[int]:
    """Columns of `part_features` or `scene_features` that networks read, places first.

    Args:
        task: parts or scene.
        inputs: xyz, normals (places and normals) or features (these, then all others).

    Raises:
        ConfigError: There is no such task or kind of inputs.
    """
    if task not in TASKS:
        raise ConfigError(f"task must be one of {TASKS}, got {task}")
    if inputs not in INPUTS:
        raise ConfigError(f"inputs must be one of {INPUTS}, got {inputs}")
    return _COLUMNS[task, inputs]


class PlainPartPredictor:
    """Labels a full scan by random sub-clouds of its canonical frame; passes are averaged.

    The answer belongs to the set of points, not to their order: they are sorted first.
    """

    def __init__(self, path: Path, config: VotingConfig | None = None) -> None:
        """Open a network of `boltpose export`.

        Raises:
            InputFileError: The file is missing.
        """
        self.network = OnnxNetwork(path, PARTS_PLAIN)
        self.config = config or VotingConfig()

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        """Label every point of a full scan.

        Args:
            points_prior: Shape (N, 3), N >= 100, mm, frame `prior`.
            normals: Shape (N, 3), unit, outward.

        Returns:
            Probabilities in the order of the points.

        Raises:
            ShapeError: An argument has the wrong shape.
            DegenerateGeometryError: The scan has no cylinder to hold on to.
            InputFileError: The network cannot be used.
        """
        inputs = _checked_inputs(self.network, "parts")
        cloud, directions = as_full_scan(points_prior, normals)
        order = np.lexsort(cloud.T)
        frame, rows = describe_scan(cloud[order], directions[order], inputs)
        probabilities = np.zeros((len(cloud), len(PARTS)), dtype=np.float32)
        probabilities[order] = _label(self.network, rows, len(PARTS), self.config)
        return PartProbabilities(probabilities=probabilities, frame=frame)


class PlainScenePredictor:
    """Labels a thinned view by random sub-clouds; every point takes its voxel's answer."""

    def __init__(self, path: Path, config: VotingConfig | None = None) -> None:
        """Open a network of `boltpose export`.

        Raises:
            InputFileError: The file is missing.
        """
        self.network = OnnxNetwork(path, SCENE_PLAIN)
        self.config = config or VotingConfig()

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        """Probability, shape (N,), that each point is on the motor.

        Args:
            points_camera: Shape (N, 3), N >= 3, mm, frame `camera`.

        Raises:
            ShapeError: The shape is another one or a value is not finite.
            InputFileError: The network cannot be used.
        """
        inputs = _checked_inputs(self.network, "scene")
        cloud = as_points(points_camera, "points_camera", at_least=3)
        order = np.lexsort(cloud.T)
        described = compute_scene_features(cloud[order])
        rows = described.features[:, input_columns("scene", inputs)]
        motor = _label(self.network, rows, CLASSES["scene"], self.config)[:, 1]
        probability = np.zeros(len(cloud), dtype=np.float32)
        probability[order] = motor[described.voxel]
        return probability


def describe_scan(
    points_prior: FloatArray, normals: FloatArray, inputs: str
) -> tuple[CanonicalFrame, Float32Array]:
    """What a network reads of a full scan: its canonical frame and rows, (N, columns).

    The dense features are computed only where they are read.

    Args:
        points_prior: Shape (N, 3), N >= 100, mm, frame `prior`.
        normals: Shape (N, 3), unit, outward.
        inputs: xyz, normals or features.

    Raises:
        DegenerateGeometryError: The scan has no canonical frame.
    """
    columns = input_columns("parts", inputs)
    if inputs == "features":
        described = compute_part_features(points_prior, normals)
        return described.frame, described.features[:, columns]
    frame = find_canonical_frame(points_prior, normals)
    position = frame.canonical_from_prior.apply(points_prior) / 50
    if inputs == "xyz":
        return frame, position.astype(np.float32)
    turned = frame.canonical_from_prior.rotate(normals)
    return frame, np.concatenate([position, turned], axis=1).astype(np.float32)


def _checked_inputs(network: OnnxNetwork, task: str) -> str:
    """Kind of inputs the network reads.

    Raises:
        InputFileError: Its settings are not those of a plain network.
    """
    inputs = network.settings.get("inputs")
    if inputs not in INPUTS:
        raise InputFileError(network.path, f"inputs = {inputs}", " or ".join(INPUTS))
    network.require(columns=len(input_columns(task, inputs)))
    sub_cloud = network.settings.get("sub_cloud")
    if not isinstance(sub_cloud, int) or sub_cloud < 1:
        raise InputFileError(network.path, f"sub_cloud = {sub_cloud}", "a number of points")
    return str(inputs)


def _label(
    network: OnnxNetwork, rows: Float32Array, classes: int, config: VotingConfig
) -> Float32Array:
    """Calibrated probabilities, (N, classes)."""
    filled = rows[np.arange(max(len(rows), LEAST_POINTS)) % len(rows)]
    return temper(vote(network, filled, classes, config)[: len(rows)], network.temperature)
