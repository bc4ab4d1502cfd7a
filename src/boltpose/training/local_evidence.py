"""Stage one of both labellings: local evidence, cross-fitted so that stage two is not misled.

Stage two reads the probabilities of stage one. On motors that stage one was trained on they are
better than they will ever be on a new motor; so the clouds of family j are labelled for training
by a network that has seen neither family j nor the family left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from lightning_fabric import Fabric

from boltpose.arrays import Float32Array, IntArray
from boltpose.networks.point_mlp import PointMlp, PointMlpConfig
from boltpose.training.loop import Cloud, FitConfig, fit
from boltpose.training.weights import load_into, save_weights

Rows = Mapping[str, tuple[Float32Array, IntArray]]
"""Per family the features, (N, C), and the classes, (N,) from 0, of points to learn from."""

Vary = Callable[[Float32Array, Float32Array, np.random.Generator], Float32Array]
"""Changes features, (n, C), at random; told their standard deviations, (C,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalEvidenceConfig:
    """Recipe of stage one."""

    draw_rows: int = 256
    """Points drawn together; `fit.batch` such draws make a step."""
    hidden: int = 128
    fit: FitConfig

    def __post_init__(self) -> None:
        for name in ("draw_rows", "hidden"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")


def cross_fitting_folds(families: Iterable[str], folds: int) -> list[tuple[str, ...]]:
    """Deal families into at most so many groups, each labelled by a network blind to it."""
    ordered = sorted(families)
    return [tuple(ordered[first::folds]) for first in range(min(folds, len(ordered)))]


def join_rows(rows: Iterable[tuple[str, Float32Array, IntArray]]) -> Rows:
    """Collect features and classes, given with their family, per family."""
    features: dict[str, list[Float32Array]] = {}
    classes: dict[str, list[IntArray]] = {}
    for family, some_features, some_classes in rows:
        features.setdefault(family, []).append(some_features)
        classes.setdefault(family, []).append(some_classes)
    return {
        family: (np.concatenate(features[family]), np.concatenate(classes[family]))
        for family in features
    }


def fit_local_evidence(
    rows: Rows,
    without: Iterable[str],
    config: LocalEvidenceConfig,
    vary: Vary,
    *,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> PointMlp:
    """Fit stage one on all families but some, from scratch or from pretrained weights."""
    left_out = set(without)
    kept = [name for name in sorted(rows) if name not in left_out]
    features = np.concatenate([rows[name][0] for name in kept])
    classes = np.concatenate([rows[name][1] for name in kept])
    torch.manual_seed(config.fit.seed)
    network = _network(rows, config)
    if pretrained is None:
        network.set_standardisation(
            torch.from_numpy(features.mean(axis=0)),
            torch.from_numpy(features.std(axis=0)).clamp_min(1e-3),
        )
    else:
        load_into(network, pretrained)
    spread = network.scale.numpy()

    def draw(rng: np.random.Generator) -> Cloud:
        index = rng.integers(0, len(features), size=config.draw_rows)
        return vary(features[index], spread, rng), classes[index]

    fit(network, draw, config.fit, fabric=fabric, on_step=on_step)
    return network


def _network(rows: Rows, config: LocalEvidenceConfig) -> PointMlp:
    """An untrained network that fits the rows."""
    inputs = {features.shape[1] for features, _ in rows.values()}
    classes = max(int(classes.max()) for _, classes in rows.values()) + 1
    return PointMlp(PointMlpConfig(inputs=inputs.pop(), classes=classes, hidden=config.hidden))


def predict_local_evidence(network: PointMlp, features: Float32Array) -> Float32Array:
    """Probabilities, (N, classes), of points by their features, (N, C)."""
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
    rows: Rows,
    config: LocalEvidenceConfig,
    vary: Vary,
    *,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> PointMlp:
    """Read the network that has not seen some families, or fit and keep it."""
    left_out = sorted(without)
    path = stage_one_path(folder, left_out)
    if path.exists():
        network = _network(rows, config)
        load_into(network, path)
        return network.eval()
    network = fit_local_evidence(
        rows, left_out, config, vary, pretrained=pretrained, fabric=fabric, on_step=on_step
    )
    # every process has looked for the file by now: they fitted together
    if fabric is None or fabric.is_global_zero:
        save_weights(path, network, {"left_out": left_out})
    if fabric is not None:
        fabric.barrier()
    return network
