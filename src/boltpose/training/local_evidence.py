"""Stage one of the part networks: local evidence, cross-fitted so that stage two is not misled.

Stage two reads the probabilities of stage one. On motors that stage one was trained on they are
better than they will ever be on a new motor; so the motors of family j are labelled for training
by a network that has seen neither family j nor the family left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file, save_file

from boltpose.arrays import Float32Array, IntArray
from boltpose.datasets.part_clouds import PartCloud
from boltpose.networks.point_mlp import PointMlp, PointMlpConfig
from boltpose.segmentation.part_features import FEATURE_WIDTH, MIRRORED_COLUMNS
from boltpose.training.augmentation import POSITION_ONLY_COLUMNS, PositionVariation
from boltpose.training.loop import Batch, FitConfig, fit

PART_CLASSES = 6
"""`Part` 1 to 6; networks count from 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalEvidenceConfig:
    """Recipe of stage one."""

    rows_per_cloud: int = 16000
    """Points drawn from every cloud."""
    extra_rows: int = 1500
    """Points drawn besides from each of the three small classes."""
    batch_rows: int = 2048
    variation: PositionVariation = field(default_factory=PositionVariation)
    hidden: int = 128
    fit: FitConfig = field(
        default_factory=lambda: FitConfig(
            steps=1500, class_weights=(1.0, 1.0, 1.0, 1.5, 1.5, 2.0), learning_rate=3e-3
        )
    )


def draw_rows(
    clouds: Iterable[PartCloud], config: LocalEvidenceConfig, seed: int
) -> dict[str, tuple[Float32Array, IntArray]]:
    """Training rows of stage one, per family: features and classes from 0."""
    rows: dict[str, list[Float32Array]] = {}
    classes: dict[str, list[IntArray]] = {}
    for number, cloud in enumerate(clouds):
        rng = np.random.default_rng([seed, number])
        count = len(cloud.labels)
        picks = [rng.permutation(count)[: config.rows_per_cloud]]
        for small in (4, 5, 6):
            picks.append(
                rng.permutation(np.flatnonzero(cloud.labels == small))[: config.extra_rows]
            )
        index = np.concatenate(picks)
        rows.setdefault(cloud.family, []).append(cloud.features[index])
        classes.setdefault(cloud.family, []).append(cloud.labels[index].astype(np.int64) - 1)
    return {name: (np.concatenate(rows[name]), np.concatenate(classes[name])) for name in rows}


def fit_local_evidence(
    rows: dict[str, tuple[Float32Array, IntArray]],
    without: Iterable[str],
    config: LocalEvidenceConfig,
    *,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> PointMlp:
    """Fit stage one on all families but some."""
    left_out = set(without)
    kept = [name for name in sorted(rows) if name not in left_out]
    features = torch.from_numpy(np.concatenate([rows[name][0] for name in kept]))
    classes = torch.from_numpy(np.concatenate([rows[name][1] for name in kept]))
    torch.manual_seed(config.fit.seed)
    network = PointMlp(
        PointMlpConfig(inputs=FEATURE_WIDTH, classes=PART_CLASSES, hidden=config.hidden)
    )
    network.set_standardisation(features.mean(0), features.std(0).clamp_min(1e-3))

    spread = network.scale[POSITION_ONLY_COLUMNS].numpy()

    def sample(rng: np.random.Generator) -> Batch:
        index = torch.from_numpy(rng.integers(0, len(features), size=config.batch_rows))
        inputs = features[index]
        mirrored = torch.from_numpy(rng.random(config.batch_rows) < 0.5)
        for column in MIRRORED_COLUMNS:
            inputs[mirrored, column] *= -1
        draws = (config.batch_rows, len(POSITION_ONLY_COLUMNS))
        inputs[:, POSITION_ONLY_COLUMNS] = torch.from_numpy(
            config.variation.apply(inputs[:, POSITION_ONLY_COLUMNS].numpy(), spread, draws, rng)
        )
        return inputs, classes[index]

    fit(network, sample, config.fit, on_step=on_step)
    return network


def predict_local_evidence(network: PointMlp, features: Float32Array) -> Float32Array:
    """Probabilities, (N, 6), of points by their features, (N, FEATURE_WIDTH)."""
    chunks: list[Float32Array] = []
    with torch.inference_mode():
        for start in range(0, len(features), 8192):
            scores = network(torch.from_numpy(features[start : start + 8192]))
            chunks.append(torch.softmax(scores, dim=1).numpy())
    return np.concatenate(chunks)


def stage_one_path(folder: Path, without: Iterable[str]) -> Path:
    """File of the network that has not seen some families."""
    return folder / f"local_without_{'+'.join(sorted(without)) or 'none'}.safetensors"


def load_or_fit_local_evidence(
    folder: Path,
    without: Iterable[str],
    rows: dict[str, tuple[Float32Array, IntArray]],
    config: LocalEvidenceConfig,
    *,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> PointMlp:
    """Read the network that has not seen some families, or fit and keep it."""
    left_out = sorted(without)
    path = stage_one_path(folder, left_out)
    if path.exists():
        network = PointMlp(
            PointMlpConfig(inputs=FEATURE_WIDTH, classes=PART_CLASSES, hidden=config.hidden)
        )
        network.load_state_dict(load_file(path))
        return network.eval()
    network = fit_local_evidence(rows, left_out, config, on_step=on_step)
    folder.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    save_file(network.state_dict(), temporary)
    temporary.replace(path)
    return network
