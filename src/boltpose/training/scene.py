"""Train the scene networks: motor or not, for the voxels of a view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from lightning_fabric import Fabric
from scipy.spatial.transform import Rotation

from boltpose.arrays import Float32Array, IntArray
from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.datasets.scene_clouds import load_scene_clouds
from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.point_mlp import PointMlp
from boltpose.segmentation.scene_features import (
    LOCAL_COLUMNS,
    ROTATED_COLUMNS,
    SCALED_COLUMNS,
    SCENE_INPUT_WIDTH,
    assemble_scene_inputs,
)
from boltpose.training.hardware import first_process_first
from boltpose.training.local_evidence import (
    LocalEvidenceConfig,
    cross_fitting_folds,
    join_rows,
    load_or_fit_local_evidence,
    predict_local_evidence,
)
from boltpose.training.loop import FitConfig, Progress, fit
from boltpose.training.weights import load_into

SCENE_LOCAL_WEIGHTS = "scene_local.safetensors"
SCENE_WEIGHTS = "scene.safetensors"


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneConfig:
    """Recipe of the scene networks; the same for every family left out."""

    local: LocalEvidenceConfig = field(
        default_factory=lambda: LocalEvidenceConfig(fit=FitConfig(steps=1000, learning_rate=3e-3))
    )
    sub_cloud: int = 1024
    """Voxels of a sub-cloud."""
    channels: int = 48
    layers: int = 2
    embedding: int = 128
    turn_rad: float = 0.6
    """Sigma of the turn about the plate's normal; the camera stands anywhere."""
    tilt_rad: float = 0.05
    """Sigma of the tilt of the plate: it is not found exactly."""
    scale_range: tuple[float, float] = (0.9, 1.1)
    folds: int = 6
    """Groups of families in the cross-fitting of stage one: each of reman18's six by itself."""
    crop_probability: float = 0.2
    """How often a side of the scene is cut away."""
    local_weight: float = 0.0
    """Share of stage one in the final vote, in logarithms of probabilities; it does not help."""
    fit: FitConfig = field(
        default_factory=lambda: FitConfig(steps=500, learning_rate=2e-3, use_bfloat16=True)
    )
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("folds", "sub_cloud"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        low, high = self.scale_range
        if not 0 < low <= high:
            raise ValueError(f"scale_range must be 0 < low <= high, got {self.scale_range}")
        if not 0 <= self.crop_probability <= 1:
            raise ValueError(f"crop_probability must be in [0, 1], got {self.crop_probability}")
        if not 0 <= self.local_weight < 1:
            raise ValueError(f"local_weight must be in [0, 1), got {self.local_weight}")

    @classmethod
    def for_many_motors(cls) -> SceneConfig:
        """Recipe for hundreds of views: the same networks, trained longer."""
        base = cls()
        return replace(
            base,
            folds=3,
            local=replace(base.local, fit=replace(base.local.fit, steps=1200)),
            fit=replace(base.fit, steps=1500),
        )

    @classmethod
    def for_fine_tuning(cls) -> SceneConfig:
        """Recipe for few views, from networks that have seen many synthetic ones."""
        base = cls()
        return replace(
            base,
            local=replace(base.local, fit=replace(base.local.fit, steps=600, learning_rate=1e-3)),
            fit=replace(base.fit, steps=400, learning_rate=1e-3),
        )

    def describe(self) -> dict[str, object]:
        """The recipe as JSON-ready values, for model cards and metrics."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SceneNetworks:
    """Both stages, fitted."""

    local: PointMlp
    context: Pct


Pool = list[tuple[Float32Array, IntArray]]
"""Per view the inputs of stage two, (G, SCENE_INPUT_WIDTH), and the classes: 1 is motor."""


def augment(inputs: Float32Array, config: SceneConfig, rng: np.random.Generator) -> Float32Array:
    """Turn, mirror, scale and shift a scene; shape (G, SCENE_INPUT_WIDTH) to the same shape."""
    changed = inputs.copy()
    tilt = Rotation.from_rotvec([*rng.normal(scale=config.tilt_rad, size=2), 0.0])
    about_up = Rotation.from_rotvec([0.0, 0.0, rng.normal(scale=config.turn_rad)])
    turn = (tilt * about_up).as_matrix()
    if rng.random() < 0.5:
        turn = turn * np.array([-1.0, 1.0, 1.0])
    for columns in ROTATED_COLUMNS:
        changed[:, columns] = changed[:, columns] @ turn.T.astype(np.float32)
    changed[:, SCALED_COLUMNS] *= np.float32(rng.uniform(*config.scale_range))
    changed[:, ROTATED_COLUMNS[0]] += rng.normal(scale=0.1, size=3).astype(np.float32)
    return changed


def sample_scene(
    scene: tuple[Float32Array, IntArray], config: SceneConfig, rng: np.random.Generator
) -> tuple[Float32Array, IntArray]:
    """Draw an augmented sub-cloud, (sub_cloud, SCENE_INPUT_WIDTH), and its classes."""
    inputs, classes = scene
    pool = np.arange(len(inputs))
    if rng.random() < config.crop_probability:
        side = inputs[:, ROTATED_COLUMNS[0]] @ rng.normal(size=3)
        pool = np.flatnonzero(side < np.quantile(side, rng.uniform(0.6, 1.0)))
    index = rng.choice(pool, size=config.sub_cloud, replace=len(pool) < config.sub_cloud)
    return augment(inputs[index], config, rng), classes[index]


def train_scene(
    data: LabelledMotors,
    leave_out: str | None,
    cache: Path,
    config: SceneConfig | None = None,
    *,
    run: Path,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    workers: int = 1,
    on_progress: Progress = lambda what, step, steps, loss: None,
) -> SceneNetworks:
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
    recipe = config or SceneConfig()
    if leave_out is not None:
        data.motors_of(leave_out)
    views = sum(data.view_count(motor) for motor in data.motors)
    done = iter(range(views))
    with first_process_first(fabric):
        clouds = load_scene_clouds(
            data,
            cache / "scene_clouds",
            on_view=lambda: on_progress("features", next(done), views, 0.0),
            workers=workers,
        )
    classes = [(cloud.motor_share > 0.5).astype(np.int64) for cloud in clouds]
    rows = join_rows(
        (cloud.family, cloud.described.features[:, LOCAL_COLUMNS], labels)
        for cloud, labels in zip(clouds, classes, strict=True)
    )

    def local(without: set[str]) -> PointMlp:
        name = "local evidence without " + (", ".join(sorted(without)) or "none")
        return load_or_fit_local_evidence(
            run / "scene_stage_one",
            without,
            rows,
            recipe.local,
            lambda features, spread, rng: features,
            pretrained=None if pretrained is None else pretrained / SCENE_LOCAL_WEIGHTS,
            fabric=fabric,
            on_step=lambda step, loss: on_progress(name, step, recipe.local.fit.steps, loss),
        )

    outer = set() if leave_out is None else {leave_out}
    fold_of = {
        family: set(fold)
        for fold in cross_fitting_folds({cloud.family for cloud in clouds} - outer, recipe.folds)
        for family in fold
    }
    pool: Pool = []
    for cloud, labels in zip(clouds, classes, strict=True):
        if cloud.family in outer:
            continue
        features = cloud.described.features[:, LOCAL_COLUMNS]
        motor = predict_local_evidence(local(outer | fold_of[cloud.family]), features)[:, 1]
        pool.append((assemble_scene_inputs(cloud.described, motor), labels))
    context = fit_scene(
        pool,
        recipe,
        pretrained=None if pretrained is None else pretrained / SCENE_WEIGHTS,
        fabric=fabric,
        checkpoint=run / f"scene_without_{leave_out or 'none'}.safetensors",
        log=run,
        on_step=lambda step, loss: on_progress("scene", step, recipe.fit.steps, loss),
    )
    return SceneNetworks(local=local(outer), context=context)


def fit_scene(
    pool: Pool,
    recipe: SceneConfig,
    *,
    pretrained: Path | None = None,
    fabric: Fabric | None = None,
    checkpoint: Path | None = None,
    log: Path | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> Pct:
    """Fit stage two to pooled views."""
    torch.manual_seed(recipe.seed)
    network = Pct(
        PctConfig.small(
            SCENE_INPUT_WIDTH,
            2,
            channels=recipe.channels,
            layers=recipe.layers,
            embedding=recipe.embedding,
        )
    )
    if pretrained is None:
        rng = np.random.default_rng(recipe.seed)
        seen = torch.from_numpy(
            np.concatenate([augment(inputs[::5], recipe, rng) for inputs, _ in pool])
        )
        network.set_standardisation(seen.mean(0), seen.std(0).clamp_min(1e-3))
    else:
        load_into(network, pretrained)

    fit(
        network,
        lambda rng: sample_scene(pool[int(rng.integers(len(pool)))], recipe, rng),
        recipe.fit,
        fabric=fabric,
        checkpoint=checkpoint,
        log=log,
        on_step=on_step,
    )
    return network
