"""Train the scene network: motor or not, for the voxels of a view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from boltpose.arrays import Float32Array, IntArray
from boltpose.datasets.reman18 import Reman18
from boltpose.datasets.scene_clouds import SceneCloud, load_scene_clouds
from boltpose.networks.pct import Pct, PctConfig
from boltpose.segmentation.scene_features import ROTATED_COLUMNS, SCALED_COLUMNS, SCENE_WIDTH
from boltpose.training.loop import Batch, FitConfig, fit


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneConfig:
    """Recipe of the scene network; the same for every family left out."""

    sub_cloud: int = 2048
    """Voxels of a sub-cloud."""
    batch: int = 4
    channels: int = 48
    layers: int = 2
    embedding: int = 128
    tilt_rad: float = 0.2
    """Sigma of the turn about axes across the viewing direction; about it any turn is made."""
    scale_range: tuple[float, float] = (0.9, 1.1)
    crop_probability: float = 0.2
    """How often a side of the scene is cut away."""
    fit: FitConfig = field(
        default_factory=lambda: FitConfig(steps=600, learning_rate=2e-3, use_bfloat16=True)
    )
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("sub_cloud", "batch"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        low, high = self.scale_range
        if not 0 < low <= high:
            raise ValueError(f"scale_range must be 0 < low <= high, got {self.scale_range}")
        if not 0 <= self.crop_probability <= 1:
            raise ValueError(f"crop_probability must be in [0, 1], got {self.crop_probability}")

    def describe(self) -> dict[str, object]:
        """The recipe as JSON-ready values, for model cards and metrics."""
        return asdict(self)


def augment(features: Float32Array, config: SceneConfig, rng: np.random.Generator) -> Float32Array:
    """Turn, mirror, scale and shift a scene; shape (G, SCENE_WIDTH) to the same shape."""
    changed = features.copy()
    tilt = Rotation.from_rotvec([*rng.normal(scale=config.tilt_rad, size=2), 0.0])
    turn = (tilt * Rotation.from_rotvec([0.0, 0.0, rng.uniform(-np.pi, np.pi)])).as_matrix()
    if rng.random() < 0.5:
        turn = turn * np.array([-1.0, 1.0, 1.0])
    for columns in ROTATED_COLUMNS:
        changed[:, columns] = changed[:, columns] @ turn.T.astype(np.float32)
    changed[:, SCALED_COLUMNS] *= np.float32(rng.uniform(*config.scale_range))
    changed[:, ROTATED_COLUMNS[0]] += rng.normal(scale=0.2, size=3).astype(np.float32)
    changed[:, 6] += np.float32(rng.normal(scale=0.1))
    return changed


def sample_scene(
    cloud: SceneCloud, config: SceneConfig, rng: np.random.Generator
) -> tuple[Float32Array, IntArray]:
    """Draw an augmented sub-cloud, (sub_cloud, SCENE_WIDTH), and its classes: 1 is motor."""
    pool = np.arange(len(cloud.features))
    if rng.random() < config.crop_probability:
        side = cloud.features[:, 0:3] @ rng.normal(size=3)
        pool = np.flatnonzero(side < np.quantile(side, rng.uniform(0.6, 1.0)))
    index = rng.choice(pool, size=config.sub_cloud, replace=len(pool) < config.sub_cloud)
    classes = (cloud.motor_share[index] > 0.5).astype(np.int64)
    return augment(cloud.features[index], config, rng), classes


def train_scene(
    data: Reman18,
    leave_out: str | None,
    cache: Path,
    config: SceneConfig | None = None,
    *,
    on_progress: Callable[[str, int, int, float], None] = lambda what, step, steps, loss: None,
) -> Pct:
    """Train the scene network on all families but one; interrupted runs go on.

    Args:
        data: The labelled motors.
        leave_out: Family the training may not see; None for the shipped network.
        cache: Folder for features and checkpoints.
        config: The recipe.
        on_progress: Told every step.

    Returns:
        The network, in evaluation mode.

    Raises:
        ValueError: There is no such family.
    """
    recipe = config or SceneConfig()
    if leave_out is not None:
        data.motors_of(leave_out)
    clouds = [
        cloud
        for cloud in load_scene_clouds(data, cache / "scene_clouds")
        if cloud.family != leave_out
    ]
    return fit_scene(
        clouds,
        recipe,
        checkpoint=cache / f"scene_without_{leave_out or 'none'}.safetensors",
        on_step=lambda step, loss: on_progress("scene", step, recipe.fit.steps, loss),
    )


def fit_scene(
    clouds: list[SceneCloud],
    recipe: SceneConfig,
    *,
    checkpoint: Path | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> Pct:
    """Fit the scene network to described views."""
    torch.manual_seed(recipe.seed)
    network = Pct(
        PctConfig(
            inputs=SCENE_WIDTH,
            classes=2,
            channels=recipe.channels,
            layers=recipe.layers,
            embedding=recipe.embedding,
        )
    )
    rng = np.random.default_rng(recipe.seed)
    seen = torch.from_numpy(
        np.concatenate([augment(cloud.features[::5], recipe, rng) for cloud in clouds])
    )
    network.set_standardisation(seen.mean(0), seen.std(0).clamp_min(1e-3))

    def batch(rng: np.random.Generator) -> Batch:
        drawn = [
            sample_scene(clouds[rng.integers(len(clouds))], recipe, rng)
            for _ in range(recipe.batch)
        ]
        return (
            torch.from_numpy(np.stack([inputs for inputs, _ in drawn])),
            torch.from_numpy(np.stack([classes for _, classes in drawn])),
        )

    fit(network, batch, recipe.fit, checkpoint=checkpoint, on_step=on_step)
    return network
