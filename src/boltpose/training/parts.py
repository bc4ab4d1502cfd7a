"""Train the part networks: local evidence, then PCT with context."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from lightning_fabric import Fabric

from boltpose.arrays import Float32Array, IntArray
from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.datasets.part_clouds import PartCloud, PartCloudConfig, load_part_clouds
from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.point_mlp import PointMlp
from boltpose.schema import Part
from boltpose.segmentation.context import Neighbourhoods
from boltpose.segmentation.part_features import (
    CONTEXT_RADII_MM,
    INPUT_WIDTH,
    MIRRORED_COLUMNS,
    assemble_inputs,
)
from boltpose.segmentation.predictor import PARTS
from boltpose.training.augmentation import POSITION_ONLY_COLUMNS, PositionVariation
from boltpose.training.hardware import first_process_first
from boltpose.training.local_evidence import (
    LocalEvidenceConfig,
    Rows,
    cross_fitting_folds,
    join_rows,
    load_or_fit_local_evidence,
    predict_local_evidence,
)
from boltpose.training.loop import Cloud, FitConfig, Progress, fit
from boltpose.training.weights import load_into

logger = logging.getLogger(__name__)

PARTS_LOCAL_WEIGHTS = "parts_local.safetensors"
PARTS_WEIGHTS = "parts.safetensors"


@dataclass(frozen=True, slots=True, kw_only=True)
class PartsConfig:
    """Recipe of the part networks; the same for every family left out."""

    clouds: PartCloudConfig = field(default_factory=PartCloudConfig)
    folds: int = 6
    """Groups of families in the cross-fitting of stage one: each of reman18's six by itself."""
    rows_per_cloud: int = 16000
    """Points of every cloud that stage one learns from."""
    extra_rows: int = 1500
    """Points it learns from besides, from each of the three small classes."""
    local: LocalEvidenceConfig = field(
        default_factory=lambda: LocalEvidenceConfig(
            fit=FitConfig(
                steps=1500, class_weights=(1.0, 1.0, 1.0, 1.5, 1.5, 2.0), learning_rate=3e-3
            )
        )
    )
    pool: int = 24000
    """Points of every cloud that sub-clouds are drawn from."""
    sub_cloud: int = 1024
    """Points of a sub-cloud. The paper takes 2048; the features carry the resolution here, and
    half as many give the same scores in half the time."""
    channels: int = 64
    layers: int = 2
    """Offset-attention layers. The paper has 4; 2 transfer better to an unseen family."""
    variation: PositionVariation = field(default_factory=PositionVariation)
    jitter: float = 0.01
    """Sigma of the noise on standardised inputs, drawn point by point."""
    local_weight: float = 0.5
    """Share of stage one in the final vote, in logarithms of probabilities. Half is better than
    stage two alone on families not seen."""
    fit: FitConfig = field(
        default_factory=lambda: FitConfig(
            steps=400,
            learning_rate=2e-3,
            class_weights=(1.0, 1.0, 1.0, 2.0, 2.0, 3.0),
            use_bfloat16=True,
        )
    )
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("folds", "pool", "sub_cloud"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        if not 0 <= self.local_weight < 1:
            raise ValueError(f"local_weight must be in [0, 1), got {self.local_weight}")
        if self.pool < self.sub_cloud:
            raise ValueError(f"pool must be >= sub_cloud, got {self.pool} < {self.sub_cloud}")

    @classmethod
    def for_many_motors(cls) -> PartsConfig:
        """Recipe for hundreds of motors: the same networks, fewer points of each, longer."""
        base = cls()
        return replace(
            base,
            clouds=replace(base.clouds, copies=1),
            folds=3,
            rows_per_cloud=3000,
            extra_rows=700,
            local=replace(base.local, fit=replace(base.local.fit, steps=2000)),
            pool=8000,
            fit=replace(base.fit, steps=2000),
        )

    @classmethod
    def for_fine_tuning(cls) -> PartsConfig:
        """Recipe for few motors, from networks that have seen many synthetic ones."""
        base = cls()
        return replace(
            base,
            local=replace(base.local, fit=replace(base.local.fit, steps=600, learning_rate=1e-3)),
            fit=replace(base.fit, steps=300, learning_rate=1e-3),
        )

    def describe(self) -> dict[str, object]:
        """The recipe as JSON-ready values, for model cards and metrics."""
        return asdict(self)


Pool = list[tuple[Float32Array, IntArray]]
"""Per cloud the inputs of stage two and the classes from 0."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PartNetworks:
    """Both stages, fitted."""

    local: PointMlp
    context: Pct
    loss: float


def train_parts(
    data: LabelledMotors,
    leave_out: str | None,
    cache: Path,
    config: PartsConfig | None = None,
    *,
    run: Path,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    workers: int = 1,
    on_progress: Progress = lambda what, step, steps, loss: None,
) -> PartNetworks:
    """Train both stages on all families but one; interrupted runs go on where they stopped.

    Args:
        data: The labelled motors.
        leave_out: Family no part of the training may see; None for the shipped networks.
        cache: Folder for features, shared by all runs on the same data.
        config: The recipe.
        run: Folder for stage-one networks, checkpoint and log.
        pretrained: Folder with the weights of both stages to start from.
        fabric: Launched hardware; one process on one processor by default.
        workers: Processes that compute features; the networks do not depend on it.
        on_progress: Told every step.

    Returns:
        The networks, in evaluation mode.

    Raises:
        ValueError: There is no such family.
        InputFileError: The pretrained weights are missing or of other networks.
    """
    recipe = config or PartsConfig()
    if leave_out is not None:
        data.motors_of(leave_out)
    motors = len(data.motors)
    done = iter(range(motors))
    with first_process_first(fabric):
        clouds = load_part_clouds(
            data,
            cache / "part_clouds",
            config=recipe.clouds,
            seed=recipe.seed,
            workers=workers,
            on_motor=lambda motor: on_progress("features", next(done), motors, 0.0),
        )
    rows = draw_rows(clouds, recipe)
    vary = partial(_vary_rows, recipe.variation)

    def local(without: set[str]) -> PointMlp:
        name = "local evidence without " + (", ".join(sorted(without)) or "none")
        return load_or_fit_local_evidence(
            run / "stage_one",
            without,
            rows,
            recipe.local,
            vary,
            pretrained=None if pretrained is None else pretrained / PARTS_LOCAL_WEIGHTS,
            fabric=fabric,
            on_step=lambda step, loss: on_progress(name, step, recipe.local.fit.steps, loss),
        )

    outer = set() if leave_out is None else {leave_out}
    pool: Pool = []
    for fold in cross_fitting_folds(set(clouds.families) - outer, recipe.folds):
        network = local(outer | set(fold))
        for family in fold:
            for number, cloud in enumerate(clouds.of_family(family)):
                rng = np.random.default_rng([recipe.seed, len(pool), number])
                pool.append(_pool_of(cloud, network, recipe.pool, rng))
                logger.info("pooled %s", cloud.motor)
    network = fit_context(
        pool,
        recipe,
        pretrained=None if pretrained is None else pretrained / PARTS_WEIGHTS,
        fabric=fabric,
        checkpoint=run / f"parts_without_{leave_out or 'none'}.safetensors",
        log=run,
        on_step=lambda step, loss: on_progress("parts", step, recipe.fit.steps, loss),
    )
    return PartNetworks(local=local(outer), context=network[0], loss=network[1])


def draw_rows(clouds: Iterable[PartCloud], recipe: PartsConfig) -> Rows:
    """Points that stage one learns from."""

    def draw(number: int, cloud: PartCloud) -> tuple[str, Float32Array, IntArray]:
        rng = np.random.default_rng([recipe.seed, number])
        picks = [rng.permutation(len(cloud.labels))[: recipe.rows_per_cloud]]
        for small in (Part.ELECTRICAL_CONNECTOR, Part.GEAR, Part.BOLT):
            members = np.flatnonzero(cloud.labels == small)
            picks.append(rng.permutation(members)[: recipe.extra_rows])
        index = np.concatenate(picks)
        return cloud.family, cloud.features[index], cloud.labels[index].astype(np.int64) - 1

    return join_rows(draw(number, cloud) for number, cloud in enumerate(clouds))


def _vary_rows(
    variation: PositionVariation,
    features: Float32Array,
    spread: Float32Array,
    rng: np.random.Generator,
) -> Float32Array:
    """Mirror and vary points one by one, as stage one sees them."""
    mirrored = rng.random(len(features)) < 0.5
    for column in MIRRORED_COLUMNS:
        features[mirrored, column] *= -1
    features[:, POSITION_ONLY_COLUMNS] = variation.apply(
        features[:, POSITION_ONLY_COLUMNS],
        spread[POSITION_ONLY_COLUMNS],
        (len(features), len(POSITION_ONLY_COLUMNS)),
        rng,
    )
    return features


def fit_context(
    pool: Pool,
    recipe: PartsConfig,
    *,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    checkpoint: Path | None = None,
    log: Path | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> tuple[Pct, float]:
    """Fit stage two to pooled inputs; returns the network and its last loss."""
    torch.manual_seed(recipe.seed)
    network = Pct(
        PctConfig.small(INPUT_WIDTH, len(PARTS), channels=recipe.channels, layers=recipe.layers)
    )
    if pretrained is None:
        sample = torch.from_numpy(np.concatenate([inputs[::7] for inputs, _ in pool]))
        network.set_standardisation(sample.mean(0), sample.std(0).clamp_min(1e-3))
    else:
        load_into(network, pretrained)
    jitter = np.float32(recipe.jitter) * network.scale.numpy()
    spread = network.scale[POSITION_ONLY_COLUMNS].numpy()

    def draw(rng: np.random.Generator) -> Cloud:
        inputs, labels = pool[int(rng.integers(len(pool)))]
        index = rng.choice(len(inputs), size=recipe.sub_cloud, replace=False)
        cloud = inputs[index]
        if rng.random() < 0.5:
            cloud[:, MIRRORED_COLUMNS] *= -1
        cloud[:, POSITION_ONLY_COLUMNS] = recipe.variation.apply(
            cloud[:, POSITION_ONLY_COLUMNS], spread, (len(POSITION_ONLY_COLUMNS),), rng
        )
        cloud += jitter * rng.standard_normal(cloud.shape, dtype=np.float32)
        return cloud, labels[index]

    loss = fit(
        network, draw, recipe.fit, fabric=fabric, checkpoint=checkpoint, log=log, on_step=on_step
    )
    return network, loss


def _pool_of(
    cloud: PartCloud, network: PointMlp, size: int, rng: np.random.Generator
) -> tuple[Float32Array, IntArray]:
    """Inputs of stage two and classes of some points of a cloud."""
    index = np.sort(rng.permutation(len(cloud.labels))[:size])
    local = predict_local_evidence(network, cloud.features)
    around = Neighbourhoods(cloud.points, CONTEXT_RADII_MM, at=index).average(local)
    inputs = assemble_inputs(cloud.features[index], local[index], around)
    return inputs, cloud.labels[index].astype(np.int64) - 1
