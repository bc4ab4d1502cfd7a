"""Where sub-clouds of labelled scans and views come from, and how they are varied in training."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import Float32Array, IntArray
from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.datasets.part_clouds import PartCloudConfig, load_part_clouds
from boltpose.datasets.scene_clouds import load_scene_clouds
from boltpose.errors import ConfigError
from boltpose.segmentation.part_features import FEATURE_CONFIG
from boltpose.segmentation.plain import CLASSES, input_columns


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LabelledInputs:
    """One full scan or one view, as a network reads it."""

    motor: str
    inputs: Float32Array
    """Shape (N, columns)."""
    classes: IntArray
    """Shape (N,), from 0: parts in the order of `Part`, or background and motor."""
    counts: IntArray
    """Shape (N, classes), measured points of each class that the row stands for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudVariation:
    """Changes to the places and normals of a sub-cloud; none of them changes a class."""

    turn_rad: float
    """Sigma of the turn about z."""
    tilt_rad: float
    """Sigma of the turns about x and y."""
    scale_range: tuple[float, float] = (0.9, 1.1)
    shift: float = 0.05
    """Sigma of the displacement of the whole, in units of the inputs."""
    jitter: float = 0.01
    """Sigma of the displacement of every point, in units of the inputs."""
    is_mirrored: bool = True
    """Mirror every other sub-cloud at its y-z plane."""

    def __post_init__(self) -> None:
        low, high = self.scale_range
        if not 0 < low <= high:
            raise ConfigError(f"scale_range must be 0 < low <= high, got {self.scale_range}")
        for name in ("turn_rad", "tilt_rad", "shift", "jitter"):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"{name} must be >= 0, got {getattr(self, name)}")

    def apply(self, inputs: Float32Array, rng: np.random.Generator) -> Float32Array:
        """Vary a sub-cloud, (N, columns), into a new one of the same shape."""
        varied = inputs.copy()
        angles = rng.normal(scale=(self.tilt_rad, self.tilt_rad, self.turn_rad))
        turn = Rotation.from_rotvec(angles).as_matrix()
        if self.is_mirrored and rng.random() < 0.5:
            turn = turn * np.array([-1.0, 1.0, 1.0])
        scale = rng.uniform(*self.scale_range)
        shift = rng.normal(scale=self.shift, size=3)
        noise = rng.normal(scale=self.jitter, size=(len(inputs), 3))
        varied[:, :3] = inputs[:, :3] @ turn.T * scale + shift + noise
        if inputs.shape[1] >= 6:
            varied[:, 3:6] = inputs[:, 3:6] @ turn.T
        return varied


PART_VARIATION = CloudVariation(turn_rad=0.05, tilt_rad=0.05)
SCENE_VARIATION = CloudVariation(turn_rad=0.6, tilt_rad=0.05)


@dataclass(frozen=True, slots=True, kw_only=True)
class PoolConfig:
    """How much of every scan is kept in memory to draw sub-clouds from."""

    task: str = "parts"
    inputs: str = "xyz"
    points: int = 32768
    """At most so many points of each scan; all are used for scoring."""
    clouds: PartCloudConfig = field(default_factory=lambda: PartCloudConfig(copies=1))
    seed: int = 0

    def __post_init__(self) -> None:
        input_columns(self.task, self.inputs)
        if self.points < 1:
            raise ConfigError(f"points must be >= 1, got {self.points}")


def load_pool(
    data: LabelledMotors,
    motors: Sequence[str],
    config: PoolConfig,
    cache: Path,
    *,
    workers: int = 1,
    on_scan: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[LabelledInputs, ...]:
    """The scans or views of some motors, thinned to what training draws from.

    Args:
        data: The labelled motors.
        motors: Names of the wanted ones.
        config: Which inputs, how many points.
        cache: Folder for features and, one file per motor, for the thinned clouds.
        workers: Processes that compute features.
        on_scan: Told how many motors or views are ready, and how many there are.

    Returns:
        One entry per scan or view, in the order of the data set. Motors without a canonical frame
        are missing, as in `load_part_clouds`.
    """
    wanted = set(motors)
    if config.task == "scene":
        return _scene_inputs(data, wanted, config, cache, workers, on_scan)
    described = json.dumps([asdict(config), asdict(FEATURE_CONFIG)], sort_keys=True)
    key = hashlib.sha256(described.encode()).hexdigest()[:12]
    folder = cache / "pools"
    folder.mkdir(parents=True, exist_ok=True)
    total = len(data.motors)
    ready = iter(range(1, total + 1))
    clouds = load_part_clouds(
        data,
        cache / "part_clouds",
        config=config.clouds,
        seed=config.seed,
        workers=workers,
        on_motor=lambda motor: on_scan(next(ready), total),
    )
    pools: list[LabelledInputs] = []
    for number, motor in enumerate(clouds.motors):
        if motor not in wanted:
            continue
        path = folder / f"{motor}_{key}.npz"
        if not path.exists():
            cloud = next(iter(clouds.of_motor(motor)))
            rng = np.random.default_rng([config.seed, number])
            index = np.sort(rng.permutation(len(cloud.labels))[: config.points])
            temporary = path.with_suffix(".tmp.npz")
            np.savez(
                temporary,
                allow_pickle=False,
                inputs=cloud.features[index][:, input_columns("parts", config.inputs)],
                classes=cloud.labels[index].astype(np.int64) - 1,
            )
            temporary.replace(path)
        with np.load(path, allow_pickle=False) as file:
            pools.append(_labelled(motor, file["inputs"], file["classes"]))
    return tuple(pools)


def full_inputs(
    data: LabelledMotors, motors: Sequence[str], config: PoolConfig, cache: Path
) -> tuple[LabelledInputs, ...]:
    """Every point of the scans or views of some motors, for scoring."""
    wanted = set(motors)
    if config.task == "scene":
        return _scene_inputs(data, wanted, config, cache, 1, lambda done, total: None)
    columns = input_columns("parts", config.inputs)
    clouds = load_part_clouds(data, cache / "part_clouds", config=config.clouds, seed=config.seed)
    return tuple(
        _labelled(motor, cloud.features[:, columns], cloud.labels.astype(np.int64) - 1)
        for motor in clouds.motors
        if motor in wanted
        for cloud in [next(iter(clouds.of_motor(motor)))]
    )


def _labelled(motor: str, inputs: Float32Array, classes: IntArray) -> LabelledInputs:
    counts = np.eye(CLASSES["parts"], dtype=np.int64)[classes]
    return LabelledInputs(motor=motor, inputs=inputs, classes=classes, counts=counts)


def _scene_inputs(
    data: LabelledMotors,
    wanted: set[str],
    config: PoolConfig,
    cache: Path,
    workers: int,
    on_scan: Callable[[int, int], None],
) -> tuple[LabelledInputs, ...]:
    total = sum(data.view_count(motor) for motor in data.motors)
    ready = iter(range(1, total + 1))
    columns = input_columns("scene", config.inputs)
    clouds = load_scene_clouds(
        data,
        cache / "scene_clouds",
        workers=workers,
        on_view=lambda: on_scan(next(ready), total),
    )
    views: list[LabelledInputs] = []
    for cloud in clouds:
        if cloud.motor in wanted:
            on_motor = np.rint(cloud.motor_share * cloud.counts).astype(np.int64)
            views.append(
                LabelledInputs(
                    motor=cloud.motor,
                    inputs=cloud.described.features[:, columns],
                    classes=(cloud.motor_share > 0.5).astype(np.int64),
                    counts=np.stack([cloud.counts - on_motor, on_motor], axis=1),
                )
            )
    return tuple(views)
