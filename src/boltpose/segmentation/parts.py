"""The part networks behind the `PartPredictor` protocol."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from boltpose.segmentation.context import Neighbourhoods
from boltpose.segmentation.onnx_session import OnnxNetwork
from boltpose.segmentation.part_features import (
    CONTEXT_RADII_MM,
    FEATURE_CONFIG,
    FEATURE_WIDTH,
    INPUT_WIDTH,
    assemble_inputs,
    compute_part_features,
)
from boltpose.segmentation.predictor import PartProbabilities, as_full_scan
from boltpose.segmentation.voting import VotingConfig, label_cloud, label_rows


class OnnxPartPredictor:
    """Local evidence from dense features, then PCT over random sub-clouds; both vote.

    The answer belongs to the set of points, not to their order: they are sorted first.
    """

    def __init__(self, local: Path, context: Path, config: VotingConfig | None = None) -> None:
        """Open the two networks of `boltpose.training.parts`.

        Raises:
            InputFileError: A file is missing.
        """
        self.local = OnnxNetwork(local, "parts_local")
        self.context = OnnxNetwork(context, "parts")
        self.config = config or VotingConfig()

    def predict(self, points_prior: npt.ArrayLike, normals: npt.ArrayLike) -> PartProbabilities:
        """Label every point of a full scan.

        Args:
            points_prior: Shape (N, 3), N >= 100, mm, frame `prior`.
            normals: Shape (N, 3), unit, outward, as `orient_outward(points,
                estimate_normals(points))` gives them.

        Returns:
            Probabilities in the order of the points.

        Raises:
            ShapeError: An argument has the wrong shape.
            DegenerateGeometryError: The scan has no cylinder to hold on to.
            InputFileError: A network cannot be used.
        """
        self.local.require(inputs=FEATURE_WIDTH, radii_mm=list(FEATURE_CONFIG.radii_mm))
        self.context.require(inputs=INPUT_WIDTH, context_radii_mm=list(CONTEXT_RADII_MM))
        cloud, directions = as_full_scan(points_prior, normals)
        order = np.lexsort(cloud.T)
        described = compute_part_features(cloud[order], directions[order])
        local = label_rows(self.local, described.features)
        around = Neighbourhoods(described.points_canonical, CONTEXT_RADII_MM).average(local)
        inputs = assemble_inputs(described.features, local, around)
        probabilities = np.zeros_like(local)
        probabilities[order] = label_cloud(self.context, local, inputs, self.config)
        return PartProbabilities(probabilities=probabilities, frame=described.frame)
