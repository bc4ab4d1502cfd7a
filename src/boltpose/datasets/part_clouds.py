"""Full scans with their features, each in a few sizes, computed once and kept on disk."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import logging
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import Float32Array, FloatArray, UInt8Array
from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.errors import DegenerateGeometryError
from boltpose.geometry.canonical import find_canonical_frame
from boltpose.geometry.normals import estimate_normals, orient_outward
from boltpose.segmentation.part_features import FEATURE_CONFIG, describe_canonical

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartCloudConfig:
    """How full scans become training clouds."""

    copies: int = 3
    """Clouds per motor; the first is the scan as it is, the others are changed as told below."""
    scale_range: tuple[float, float] = (0.9, 1.1)
    """Copies are scaled by a factor drawn from here: motors come in sizes."""
    tilt_rad: float = 0.02
    """Sigma of the small turn of copies: the canonical frame is never exact."""
    noise_mm: float = 0.03
    """Sigma of the displacement of copies along the normal."""
    keep_share: tuple[float, float] = (0.6, 1.0)
    """Copies keep this share of the points: scans differ in density."""
    normal_neighbours: int = 20

    def __post_init__(self) -> None:
        if self.copies < 1:
            raise ValueError(f"copies must be >= 1, got {self.copies}")
        for name in ("scale_range", "keep_share"):
            low, high = getattr(self, name)
            if not 0 < low <= high:
                raise ValueError(f"{name} must be 0 < low <= high, got {(low, high)}")
        if not self.tilt_rad >= 0 or not self.noise_mm >= 0:
            raise ValueError("tilt_rad and noise_mm must be >= 0")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PartCloud:
    """A full scan ready for the part networks."""

    motor: str
    family: str
    points: FloatArray
    """Shape (N, 3), mm, frame `canonical`."""
    features: Float32Array
    """Shape (N, FEATURE_WIDTH)."""
    labels: UInt8Array
    """Shape (N,), `Part` numbers 1 to 6."""


def scan_normals(points: FloatArray, neighbours: int = 20) -> FloatArray:
    """Outward unit normals of a full scan as the part networks expect them; shape (N, 3)."""
    return orient_outward(points, estimate_normals(points, neighbours))


def build_part_clouds(
    data: LabelledMotors, motor: str, config: PartCloudConfig, rng: np.random.Generator
) -> tuple[PartCloud, ...]:
    """Read a motor's full scan and make its training clouds; the first is unchanged."""
    scan = data.full_scan(motor)
    normals = scan_normals(scan.points, config.normal_neighbours)
    frame = find_canonical_frame(scan.points, normals)
    points = frame.canonical_from_prior.apply(scan.points)
    directions = frame.canonical_from_prior.rotate(normals)
    family = data.family(motor)
    clouds = [
        PartCloud(
            motor=motor,
            family=family,
            points=points,
            features=describe_canonical(points, directions, frame),
            labels=scan.labels,
        )
    ]
    for _ in range(config.copies - 1):
        keep = rng.random(len(points)) < rng.uniform(*config.keep_share)
        turn = Rotation.from_rotvec(rng.normal(scale=config.tilt_rad, size=3)).as_matrix()
        scale = rng.uniform(*config.scale_range)
        noise = rng.normal(scale=config.noise_mm, size=(len(points), 1))
        moved = ((points + noise * directions) @ turn.T * scale)[keep]
        turned = (directions @ turn.T)[keep]
        # found anew: what the frame knows of the motor (radii, ends) must fit the new size
        new_frame = find_canonical_frame(moved, turned)
        moved_frame = replace(
            frame,
            main_radius_mm=new_frame.main_radius_mm,
            second_radius_mm=new_frame.second_radius_mm,
            second_offset_mm=new_frame.second_offset_mm,
            z_range_mm=new_frame.z_range_mm,
        )
        clouds.append(
            PartCloud(
                motor=motor,
                family=family,
                points=moved,
                features=describe_canonical(moved, turned, moved_frame),
                labels=scan.labels[keep],
            )
        )
    return tuple(clouds)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartCloudSet:
    """Training clouds on disk, read one motor at a time: hundreds of motors do not fit in memory.

    Iterating gives the clouds of all motors in order.
    """

    motors: tuple[str, ...]
    families: tuple[str, ...]
    """Family of each motor."""
    paths: tuple[Path, ...]
    """File of each motor."""

    def __iter__(self) -> Iterator[PartCloud]:
        for motor, family, path in zip(self.motors, self.families, self.paths, strict=True):
            yield from _read_clouds(path, motor, family)

    def __len__(self) -> int:
        """Number of motors."""
        return len(self.motors)

    def of_family(self, family: str) -> PartCloudSet:
        """The motors of one family."""
        return self._only([number for number, name in enumerate(self.families) if name == family])

    def of_motor(self, motor: str) -> PartCloudSet:
        """One motor by its name; empty if there is none."""
        return self._only([number for number, name in enumerate(self.motors) if name == motor])

    def _only(self, kept: list[int]) -> PartCloudSet:
        return PartCloudSet(
            motors=tuple(self.motors[number] for number in kept),
            families=tuple(self.families[number] for number in kept),
            paths=tuple(self.paths[number] for number in kept),
        )


def load_part_clouds(
    data: LabelledMotors,
    cache: Path,
    *,
    config: PartCloudConfig | None = None,
    seed: int = 0,
    workers: int = 1,
    on_motor: Callable[[str], None] = lambda motor: None,
) -> PartCloudSet:
    """Training clouds of all motors; made on the first call, read from `cache` afterwards.

    Args:
        data: The motors.
        cache: Folder for one file per motor; the files' names change with the settings.
        config: How clouds are made.
        seed: Of the changes to copies.
        workers: Processes that make clouds; the result does not depend on it.
        on_motor: Called with the name of each motor once its file is there.

    Returns:
        `config.copies` clouds per motor, motors in order. Motors whose full scan has no canonical
        frame are left out, as they would be refused when a prior is built; a warning is logged.

    Raises:
        DegenerateGeometryError: No motor has a canonical frame.
    """
    setting = config or PartCloudConfig()
    described = json.dumps([asdict(setting), asdict(FEATURE_CONFIG), seed], sort_keys=True)
    key = hashlib.sha256(described.encode()).hexdigest()[:12]
    cache.mkdir(parents=True, exist_ok=True)
    tasks = [
        (data, motor, setting, (seed, number), cache / f"{motor}_{key}.npz")
        for number, motor in enumerate(data.motors)
    ]
    made: list[bool] = []
    with contextlib.ExitStack() as stack:
        if workers > 1:
            context = multiprocessing.get_context("spawn")
            pool = stack.enter_context(ProcessPoolExecutor(workers, mp_context=context))
            results = pool.map(_make_clouds, *zip(*tasks, strict=True))
        else:
            results = itertools.starmap(_make_clouds, tasks)
        for motor, is_made in zip(data.motors, results, strict=True):
            made.append(is_made)
            on_motor(motor)
    kept = [task for task, is_made in zip(tasks, made, strict=True) if is_made]
    if not kept:
        raise DegenerateGeometryError(f"no full scan under {data.root} has a canonical frame")
    if len(kept) < len(tasks):
        logger.warning(
            "%d of %d full scans have no canonical frame and are left out",
            len(tasks) - len(kept),
            len(tasks),
        )
    return PartCloudSet(
        motors=tuple(motor for _, motor, _, _, _ in kept),
        families=tuple(data.family(motor) for _, motor, _, _, _ in kept),
        paths=tuple(path for _, _, _, _, path in kept),
    )


def _make_clouds(
    data: LabelledMotors, motor: str, config: PartCloudConfig, seed: tuple[int, int], path: Path
) -> bool:
    """Make one motor's file unless it is there; False if the scan has no canonical frame."""
    if path.exists():
        return True
    try:
        clouds = build_part_clouds(data, motor, config, np.random.default_rng(seed))
    except DegenerateGeometryError:
        return False
    _write_clouds(path, clouds)
    return True


def _write_clouds(path: Path, clouds: tuple[PartCloud, ...]) -> None:
    arrays: dict[str, np.ndarray] = {}
    for number, cloud in enumerate(clouds):
        arrays[f"points_{number}"] = cloud.points.astype(np.float32)
        arrays[f"features_{number}"] = cloud.features
        arrays[f"labels_{number}"] = cloud.labels
    temporary = path.with_suffix(".tmp.npz")
    np.savez(temporary, allow_pickle=False, **arrays)
    temporary.replace(path)


def _read_clouds(path: Path, motor: str, family: str) -> tuple[PartCloud, ...]:
    with np.load(path, allow_pickle=False) as file:
        count = sum(name.startswith("labels_") for name in file.files)
        return tuple(
            PartCloud(
                motor=motor,
                family=family,
                points=file[f"points_{number}"].astype(np.float64),
                features=file[f"features_{number}"],
                labels=file[f"labels_{number}"],
            )
            for number in range(count)
        )
