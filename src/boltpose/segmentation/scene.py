"""The scene networks behind the `ScenePredictor` protocol."""

from __future__ import annotations

from pathlib import Path

import numpy.typing as npt

from boltpose.arrays import Float32Array, as_points
from boltpose.segmentation.onnx_session import OnnxNetwork
from boltpose.segmentation.scene_features import (
    CONTEXT_RADII_MM,
    LOCAL_COLUMNS,
    SCENE_CONFIG,
    SCENE_INPUT_WIDTH,
    VOXEL_MM,
    assemble_scene_inputs,
    compute_scene_features,
)
from boltpose.segmentation.voting import VotingConfig, label_cloud, label_rows


class OnnxScenePredictor:
    """Local evidence and PCT over a thinned view; every point takes its voxel's answer."""

    def __init__(self, local: Path, context: Path, config: VotingConfig | None = None) -> None:
        """Open the two networks of `boltpose.training.scene`.

        Raises:
            InputFileError: A file is missing.
        """
        self.local = OnnxNetwork(local, "scene_local")
        self.context = OnnxNetwork(context, "scene")
        self.config = config or VotingConfig()

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        """Probability, shape (N,), that each point is on the motor.

        Args:
            points_camera: Shape (N, 3), N >= 3, mm, frame `camera`.

        Raises:
            ShapeError: The shape is another one or a value is not finite.
            InputFileError: A network cannot be used.
        """
        cloud = as_points(points_camera, "points_camera", at_least=3)
        self.local.require(
            inputs=len(LOCAL_COLUMNS), radii_mm=list(SCENE_CONFIG.radii_mm), voxel_mm=VOXEL_MM
        )
        self.context.require(inputs=SCENE_INPUT_WIDTH, context_radii_mm=list(CONTEXT_RADII_MM))
        described = compute_scene_features(cloud)
        local = label_rows(self.local, described.features[:, LOCAL_COLUMNS])
        inputs = assemble_scene_inputs(described, local[:, 1])
        return label_cloud(self.context, local, inputs, self.config)[:, 1][described.voxel]
