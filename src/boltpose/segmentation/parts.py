"""The part networks behind the `PartPredictor` protocol."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, IntArray, as_points
from boltpose.errors import ShapeError
from boltpose.segmentation.context import Neighbourhoods
from boltpose.segmentation.onnx_session import OnnxNetwork, softmax
from boltpose.segmentation.part_features import (
    CONTEXT_RADII_MM,
    FEATURE_CONFIG,
    FEATURE_WIDTH,
    INPUT_WIDTH,
    assemble_inputs,
    compute_part_features,
)
from boltpose.segmentation.predictor import PARTS, PartProbabilities
from boltpose.segmentation.voting import VotingConfig, split_randomly

_THREADS = 2
_LOCAL_CHUNK = 8192
_TINY = np.float32(1e-7)


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
        cloud = as_points(points_prior, "points_prior", at_least=100)
        directions = as_points(normals, "normals")
        if directions.shape != cloud.shape:
            raise ShapeError(f"normals must have shape {cloud.shape}, got {directions.shape}")
        order = np.lexsort(cloud.T)
        described = compute_part_features(cloud[order], directions[order])
        local = _in_chunks(
            lambda part: softmax(self.local.run(described.features[part])),
            np.array_split(np.arange(len(cloud)), -(-len(cloud) // _LOCAL_CHUNK)),
            len(cloud),
        )
        around = Neighbourhoods(described.points_canonical, CONTEXT_RADII_MM).average(local)
        inputs = assemble_inputs(described.features, local, around)
        size = int(self.context.settings["sub_cloud"])
        temperature = np.float32(self.context.temperature)
        voted = np.zeros((len(cloud), len(PARTS)), dtype=np.float32)
        for turn in range(self.config.passes):
            voted += _in_chunks(
                lambda part: softmax(self.context.run(inputs[part][None])[0]),
                split_randomly(len(cloud), size, np.random.default_rng([self.config.seed, turn])),
                len(cloud),
            )
        voted /= np.float32(self.config.passes)
        weight = np.float32(self.context.settings["local_weight"])
        both = softmax((1 - weight) * np.log(voted + _TINY) + weight * np.log(local + _TINY))
        probabilities = np.zeros_like(both)
        probabilities[order] = softmax((np.log(both + _TINY) / temperature).astype(np.float32))
        return PartProbabilities(probabilities=probabilities, frame=described.frame)


def _in_chunks(
    predict: Callable[[IntArray], Float32Array], groups: list[IntArray], count: int
) -> Float32Array:
    """Run a network over groups of rows, two at a time; shape (count, 6)."""
    result = np.zeros((count, len(PARTS)), dtype=np.float32)
    with ThreadPoolExecutor(_THREADS) as pool:
        for group, rows in zip(groups, pool.map(predict, groups), strict=True):
            result[group] = rows
    return result
