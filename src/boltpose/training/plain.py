"""Train one network on sub-clouds, as the paper does: a run folder from labelled motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lightning_fabric import Fabric

from boltpose.arrays import IntArray
from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.errors import ConfigError, DegenerateGeometryError
from boltpose.networks.backbones import BACKBONES, build_backbone
from boltpose.networks.segmentation_network import SegmentationNetwork
from boltpose.segmentation.plain import CLASSES, input_columns
from boltpose.segmentation.voting import split_randomly
from boltpose.training.hardware import denormals_as_zero, first_process_first, prepare_torch
from boltpose.training.loop import Cloud, FitConfig, Progress, fit
from boltpose.training.run_folder import CHECKPOINT_FILE, WEIGHTS_FILE, claim_run
from boltpose.training.sub_clouds import (
    PART_VARIATION,
    SCENE_VARIATION,
    LabelledInputs,
    PoolConfig,
    full_inputs,
    load_pool,
)
from boltpose.training.weights import load_into, read_weights, save_weights

_PART_WEIGHTS = (1.0, 1.0, 1.0, 2.0, 2.0, 3.0)
"""Of classes 1 to 6: few points are on terminals, gears and bolts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainConfig:
    """Recipe of a network that reads sub-clouds of points."""

    task: str = "parts"
    """parts (of full scans) or scene (motor or not, in views)."""
    backbone: str = "pct"
    inputs: str = "xyz"
    """xyz, normals (xyz and normals) or features (both and the dense local features)."""
    points: int = 2048
    """Points of a sub-cloud."""
    batch: int = 4
    epochs: float = 20.0
    points_per_epoch: int = 8192
    """Points drawn from every scan or view in one epoch: larger sub-clouds mean fewer steps."""
    warm_up_epochs: float = 5.0
    learning_rate: float = 1e-3
    use_bfloat16: bool = True
    """Multiply in bfloat16, where the processor can; the paper does not say."""
    checkpoint_every: int = 100
    seed: int = 0

    def __post_init__(self) -> None:
        input_columns(self.task, self.inputs)
        if self.backbone not in BACKBONES:
            raise ConfigError(f"backbone must be one of {BACKBONES}, got {self.backbone}")
        for name in ("points", "batch", "points_per_epoch", "checkpoint_every"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be >= 1, got {getattr(self, name)}")
        if not self.epochs > 0:
            raise ConfigError(f"epochs must be > 0, got {self.epochs}")
        if not 0 <= self.warm_up_epochs <= self.epochs:
            found = f"{self.warm_up_epochs} of {self.epochs}"
            raise ConfigError(f"warm_up_epochs must be in [0, epochs], got {found}")
        if not self.learning_rate > 0:
            raise ConfigError(f"learning_rate must be > 0, got {self.learning_rate}")

    def steps(self, scans: int, processes: int = 1) -> int:
        """Steps of the whole run over so many scans or views."""
        clouds = self.epochs * scans * self.points_per_epoch / self.points
        return max(1, round(clouds / (self.batch * processes)))

    def fit_config(self, scans: int, processes: int = 1) -> FitConfig:
        """The same for the training loop."""
        return FitConfig(
            steps=self.steps(scans, processes),
            batch=self.batch,
            learning_rate=self.learning_rate,
            warmup_share=self.warm_up_epochs / self.epochs,
            class_weights=_PART_WEIGHTS if self.task == "parts" else (),
            use_bfloat16=self.use_bfloat16,
            checkpoint_every=self.checkpoint_every,
            seed=self.seed,
        )

    def pool_config(self) -> PoolConfig:
        """What is kept in memory of the scans."""
        # the dense features are 20 times as wide; a pool is drawn from many times anyway
        return PoolConfig(
            task=self.task,
            inputs=self.inputs,
            points=8192 if self.inputs == "features" else 32768,
        )


def train_plain(
    data: LabelledMotors,
    motors: Sequence[str],
    config: PlainConfig,
    out: Path,
    *,
    cache: Path,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    workers: int = 1,
    on_progress: Progress = lambda what, step, steps, loss: None,
) -> Path:
    """Train a network; an interrupted run goes on where it stopped, a finished one is kept.

    Args:
        data: The labelled motors.
        motors: Names of those to learn from.
        config: The recipe.
        out: Run folder: config.json, log.jsonl, tensorboard/, weights.safetensors at the end.
        cache: Folder for features, shared by runs on the same data.
        pretrained: Weights, or run folder, to start from; its inputs and backbone must be the same.
        fabric: Launched hardware; one process on one processor by default.
        workers: Processes that compute features.
        on_progress: Told every step.

    Returns:
        Path of the weights.

    Raises:
        ConfigError: The folder holds a run with other settings.
        InputFileError: The pretrained weights are of another network.
        DegenerateGeometryError: No motor can be learned from.
    """
    weights = out / WEIGHTS_FILE
    described = _describe(config, motors, pretrained)
    is_first = fabric is None or fabric.is_global_zero
    if is_first:
        claim_run(out, described)
    if weights.exists():
        return weights
    prepare_torch()
    with first_process_first(fabric):
        pool = load_pool(
            data,
            motors,
            config.pool_config(),
            cache,
            workers=workers,
            on_scan=lambda done, total: on_progress("features", done - 1, total, 0.0),
        )
    if not pool:
        raise DegenerateGeometryError(f"none of {len(motors)} motors of {data.root} can be used")
    network = _new_network(config)
    if pretrained is None:
        sample = torch.from_numpy(np.concatenate([cloud.inputs[::7] for cloud in pool]))
        network.set_standardisation(sample.mean(0), sample.std(0).clamp_min(1e-3))
    else:
        load_into(network, _weights_of(pretrained))
    recipe = config.fit_config(len(pool), 1 if fabric is None else fabric.world_size)
    fit(
        network,
        lambda rng: draw_sub_cloud(pool, config, rng),
        recipe,
        fabric=fabric,
        checkpoint=out / CHECKPOINT_FILE,
        log=out,
        on_step=lambda step, loss: on_progress("training", step, recipe.steps, loss),
    )
    if is_first:
        save_weights(weights, network, described)
    return weights


def draw_sub_cloud(
    pool: Sequence[LabelledInputs], config: PlainConfig, rng: np.random.Generator
) -> Cloud:
    """Draw a varied sub-cloud of `config.points` points from a random scan."""
    cloud = pool[int(rng.integers(len(pool)))]
    few = len(cloud.inputs) < config.points
    index = rng.choice(len(cloud.inputs), size=config.points, replace=few)
    variation = PART_VARIATION if config.task == "parts" else SCENE_VARIATION
    return variation.apply(cloud.inputs[index], rng), cloud.classes[index]


def load_plain(weights: Path) -> tuple[SegmentationNetwork, PlainConfig]:
    """Read a trained network, in evaluation mode, and its recipe.

    Raises:
        InputFileError: There is no such file, it is damaged, or of something else.
    """
    found = read_weights(_weights_of(weights))
    known = {name: value for name, value in found.settings.items() if name in _FIELDS}
    config = PlainConfig(**known)
    network = _new_network(config)
    load_into(network, found.path)
    return network.eval(), config


def score_plain(
    data: LabelledMotors, motors: Sequence[str], weights: Path, *, cache: Path, passes: int = 1
) -> IntArray:
    """Label every point of some motors, scans or views, and compare with the truth.

    Each pass splits a cloud into random disjoint sub-clouds; the scores of all passes are added.

    Returns:
        Confusion matrix, shape (classes, classes), true classes in rows, measured points.
    """
    prepare_torch()
    network, config = load_plain(weights)
    classes = CLASSES[config.task]
    confusion = np.zeros((classes, classes), dtype=np.int64)
    for number, cloud in enumerate(full_inputs(data, motors, config.pool_config(), cache)):
        votes = torch.zeros(len(cloud.inputs), classes)
        for turn in range(passes):
            rng = np.random.default_rng([config.seed, number, turn])
            for group in split_randomly(len(cloud.inputs), config.points, rng):
                votes[group] += _probabilities(network, cloud, group, config)
        guess = votes.argmax(dim=1).numpy()
        for label in range(classes):
            confusion[:, label] += cloud.counts[guess == label].sum(axis=0)
    return confusion


def _probabilities(
    network: SegmentationNetwork, cloud: LabelledInputs, group: IntArray, config: PlainConfig
) -> torch.Tensor:
    with (
        denormals_as_zero(),
        torch.inference_mode(),
        torch.autocast("cpu", torch.bfloat16, enabled=config.use_bfloat16),
    ):
        scores = network(torch.from_numpy(cloud.inputs[group])[None])[0]
    return torch.softmax(scores.float(), dim=1)


def _new_network(config: PlainConfig) -> SegmentationNetwork:
    torch.manual_seed(config.seed)
    columns = len(input_columns(config.task, config.inputs))
    return build_backbone(config.backbone, inputs=columns, classes=CLASSES[config.task])


_FIELDS = frozenset(asdict(PlainConfig()))


def _describe(
    config: PlainConfig, motors: Sequence[str], pretrained: Path | None
) -> dict[str, Any]:
    """All that decides the weights, JSON-ready."""
    start = None if pretrained is None else read_weights(_weights_of(pretrained)).sha256
    return {**asdict(config), "motors": sorted(motors), "pretrained": start}


def _weights_of(path: Path) -> Path:
    """The weights of a run folder, or the file itself."""
    return path / WEIGHTS_FILE if path.is_dir() else path
