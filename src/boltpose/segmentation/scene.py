"""The scene network behind the `ScenePredictor` protocol."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, IntArray, as_points
from boltpose.segmentation.onnx_session import OnnxNetwork, softmax
from boltpose.segmentation.scene_features import (
    SCENE_CONFIG,
    SCENE_WIDTH,
    VOXEL_MM,
    compute_scene_features,
)
from boltpose.segmentation.voting import VotingConfig, split_randomly

_THREADS = 2


class OnnxScenePredictor:
    """PCT over random sub-clouds of a thinned view; every point takes its voxel's answer."""

    def __init__(self, network: Path, config: VotingConfig | None = None) -> None:
        """Open the network of `boltpose.training.scene`.

        Raises:
            InputFileError: The file is missing.
        """
        self.network = OnnxNetwork(network, "scene")
        self.config = config or VotingConfig()

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        """Probability, shape (N,), that each point is on the motor.

        Args:
            points_camera: Shape (N, 3), N >= 3, mm, frame `camera`.

        Raises:
            ShapeError: The shape is another one or a value is not finite.
            InputFileError: The network cannot be used.
        """
        cloud = as_points(points_camera, "points_camera", at_least=3)
        self.network.require(
            inputs=SCENE_WIDTH, radii_mm=list(SCENE_CONFIG.radii_mm), voxel_mm=VOXEL_MM
        )
        described = compute_scene_features(cloud)
        count = len(described.features)
        size = int(self.network.settings["sub_cloud"])
        temperature = np.float32(self.network.temperature)
        voted = np.zeros(count, dtype=np.float32)

        def label(group: IntArray) -> Float32Array:
            logits = self.network.run(described.features[group][None])[0]
            return softmax(logits / temperature)[:, 1]

        with ThreadPoolExecutor(_THREADS) as pool:
            for turn in range(self.config.passes):
                rng = np.random.default_rng([self.config.seed, turn])
                groups = split_randomly(count, size, rng)
                for group, motor in zip(groups, pool.map(label, groups), strict=True):
                    voted[group] += motor
        voted /= np.float32(self.config.passes)
        return voted[described.voxel]
