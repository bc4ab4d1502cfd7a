"""Whole clouds through networks that see a thousand points at a time, and the final vote."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import Float32Array, IntArray
from boltpose.errors import InputFileError
from boltpose.segmentation.onnx_session import OnnxNetwork, softmax

_THREADS = 2
_ROWS = 8192
_TINY = np.float32(1e-7)


@dataclass(frozen=True, slots=True, kw_only=True)
class VotingConfig:
    """How a whole cloud is labelled by a network that sees a thousand points at a time."""

    passes: int = 1
    """Times every point is labelled, each time in other company; votes are averaged."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.passes < 1:
            raise ValueError(f"passes must be >= 1, got {self.passes}")


def split_randomly(count: int, size: int, rng: np.random.Generator) -> list[IntArray]:
    """Split 0 to `count` - 1 into random disjoint groups of about `size`."""
    groups = max(1, round(count / size))
    return [group.astype(np.int64) for group in np.array_split(rng.permutation(count), groups)]


def label_rows(network: OnnxNetwork, rows: Float32Array) -> Float32Array:
    """Probabilities, (N, classes), by a network that judges every row, (N, inputs), by itself."""

    def label(part: Float32Array) -> Float32Array:
        return softmax(network.run(part))

    parts = np.array_split(rows, -(-len(rows) // _ROWS))
    with ThreadPoolExecutor(_THREADS) as pool:
        return np.concatenate(list(pool.map(label, parts)))


def vote(
    network: OnnxNetwork, inputs: Float32Array, classes: int, config: VotingConfig
) -> Float32Array:
    """Label every point by random disjoint sub-clouds; each point is in one of every pass.

    Args:
        network: Maps (1, n, inputs) to (1, n, classes); its settings hold `sub_cloud`, about n.
        inputs: Shape (N, inputs).
        classes: Number of classes.
        config: Passes and seed.

    Returns:
        Mean probabilities, shape (N, classes).

    Raises:
        InputFileError: The network cannot be used, or knows other classes.
    """

    def label(group: IntArray) -> Float32Array:
        rows = softmax(network.run(inputs[group][None])[0])
        if rows.shape[1] != classes:
            raise InputFileError(network.path, f"{rows.shape[1]} classes", str(classes))
        return rows

    voted = np.zeros((len(inputs), classes), dtype=np.float32)
    with ThreadPoolExecutor(_THREADS) as pool:
        for turn in range(config.passes):
            rng = np.random.default_rng([config.seed, turn])
            groups = split_randomly(len(inputs), int(network.settings["sub_cloud"]), rng)
            for group, rows in zip(groups, pool.map(label, groups), strict=True):
                voted[group] += rows
    voted /= np.float32(config.passes)
    return voted


def temper(probabilities: Float32Array, temperature: float) -> Float32Array:
    """Sharpen, or soften if above 1, probabilities, (N, classes), that sum to 1 in every row."""
    return softmax((np.log(probabilities + _TINY) / temperature).astype(np.float32))


def label_cloud(
    network: OnnxNetwork, local: Float32Array, inputs: Float32Array, config: VotingConfig
) -> Float32Array:
    """Label every point by random disjoint sub-clouds and let stage one vote too.

    Args:
        network: Stage two; its settings hold `sub_cloud`, `local_weight` and `temperature`.
        local: Shape (N, classes), stage one's probabilities.
        inputs: Shape (N, inputs), what stage two reads.
        config: Passes and seed.

    Returns:
        Probabilities, shape (N, classes): the weighted geometric mean of both stages, sharpened
        or softened by the temperature.
    """
    voted = vote(network, inputs, local.shape[1], config)
    weight = float(network.settings["local_weight"])
    scores = (1 - weight) * np.log(voted + _TINY) + weight * np.log(local + _TINY)
    # normalised before the temperature acts: it was fitted on normalised probabilities
    return temper(softmax(scores.astype(np.float32)), network.temperature)
