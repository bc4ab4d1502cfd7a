"""Full scan -> Prior: segment, align, find the bolts. Once per motor, before production."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import FloatArray, IntArray
from boltpose.errors import ConfigError, EmptyScanError
from boltpose.geometry.normals import estimate_normals, orient_outward
from boltpose.geometry.sampling import voxel_representatives
from boltpose.prior.alignment import AlignmentConfig, align_motor
from boltpose.prior.find_bolts import FindBoltsConfig, find_bolts
from boltpose.schema import Part, Prior, Scan
from boltpose.segmentation.predictor import PartPredictor

OnStage = Callable[[str, float], None]
"""Called after each stage with its name and wall seconds; for progress and reports."""

PARTS = tuple(part for part in Part if part is not Part.BACKGROUND)
"""The columns of a probability array, in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildConfig:
    """How a prior is made from a full scan."""

    use_file_labels: bool = False
    """Take the labels the scan carries (a person's, or a CAD model's named parts) instead of the
    network's. Off by default: labels in a file must not slip in unnoticed."""
    spacing_mm: float = 0.9
    """Point spacing the networks know; denser scans are thinned to it."""
    min_points: int = 5000
    """Fewer cannot show a bolt: a head of 8 mm would get about 5 points of a 300 mm motor."""
    stray_ratio: float = 5.0
    """Points whose 4th neighbour is this many times farther than usual are strays, dropped."""
    normal_neighbours: int = 20
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    bolts: FindBoltsConfig = field(default_factory=FindBoltsConfig)

    def __post_init__(self) -> None:
        for name in ("spacing_mm", "stray_ratio"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in ("min_points", "normal_neighbours"):
            if not getattr(self, name) >= 3:
                raise ConfigError(f"{name} must be >= 3, got {getattr(self, name)}")


def build_prior(
    scan: Scan,
    predictor: PartPredictor | None = None,
    config: BuildConfig | None = None,
    *,
    name: str,
    provenance: Mapping[str, Any] | None = None,
    on_stage: OnStage | None = None,
) -> Prior:
    """Find the axes and all bolts of a motor in its full scan.

    Args:
        scan: Complete scan, mm; its own frame becomes frame `prior`.
        predictor: Part segmentation; not needed with `config.use_file_labels`.
        config: Settings; defaults if left out.
        name: What the motor is called.
        provenance: Kept in the prior beside version and settings, JSON-ready.
        on_stage: Told each stage's name and wall time.

    Returns:
        The prior, the same for the same scan; values rounded to float32 as in its file, so that
        a prior from memory and one from disk give the same poses bit for bit.

    Raises:
        EmptyScanError: Too few points.
        DegenerateGeometryError: The scan does not determine the motor's axes.
        ConfigError: Neither a predictor nor labels to use.

    Source:
        LCE 2024 (arXiv 2505.24669), sections 3.2, 3.4 and 3.5.
    """
    config = config or BuildConfig()
    if config.use_file_labels and scan.labels is None:
        raise ConfigError(f"{scan.source}: use_file_labels is set but the scan has no labels")
    if not config.use_file_labels and predictor is None:
        raise ConfigError("build_prior needs a part predictor, or labels and use_file_labels")
    stages = _Stages(on_stage)
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        keep = _thin(scan.points, config)
        if config.use_file_labels and scan.labels is not None:
            keep = keep[np.asarray(scan.labels)[keep] != Part.BACKGROUND]
        if len(keep) < config.min_points:
            raise EmptyScanError(
                f"{scan.source}: found {len(keep)} points after thinning, "
                f"wanted at least {config.min_points}: is this a complete scan in mm?"
            )
        points = _as_stored(scan.points[keep])
        stages.done("thin")
        normals = orient_outward(points, estimate_normals(points, config.normal_neighbours))
        normals = _as_stored(normals)
        stages.done("normals")
        if config.use_file_labels:
            assert scan.labels is not None
            probabilities = _one_hot(np.asarray(scan.labels)[keep])
        else:
            assert predictor is not None
            probabilities = predictor.predict(points, normals)
        labels = (probabilities.argmax(axis=1) + int(PARTS[0])).astype(np.uint8)
        stages.done("segmentation")
        alignment = align_motor(points, normals, labels, config.alignment)
        stages.done("alignment")
        bolts = find_bolts(points, normals, probabilities, alignment, config.bolts)
        stages.done("bolts")
    return Prior(
        name=name,
        points=points,
        normals=normals,
        labels=labels,
        bolts=bolts,
        alignment=alignment,
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            "labels": "file" if config.use_file_labels else "network",
            **(provenance or {}),
        },
    )


class _Stages:
    def __init__(self, on_stage: OnStage | None) -> None:
        self._on_stage = on_stage
        self._start = perf_counter()

    def done(self, name: str) -> None:
        now = perf_counter()
        if self._on_stage is not None:
            self._on_stage(name, now - self._start)
        self._start = now


def _thin(points: FloatArray, config: BuildConfig) -> IntArray:
    """Indices of the points to work on: no strays, not denser than the networks know."""
    if len(points) < config.min_points:
        return np.arange(len(points))
    step = max(1, len(points) // 20000)
    distance, _ = KDTree(points).query(points[::step], k=2, workers=-1)
    if float(np.median(distance[:, 1])) < config.spacing_mm / 2:
        keep = voxel_representatives(points, config.spacing_mm)
    else:
        keep = np.arange(len(points))
    kept = points[keep]
    distance, _ = KDTree(kept).query(kept, k=min(5, len(kept)), workers=-1)
    reach = distance[:, -1]
    return keep[reach <= config.stray_ratio * float(np.median(reach))]


def _as_stored(values: FloatArray) -> FloatArray:
    return values.astype(np.float32).astype(np.float64)


def _one_hot(labels: np.ndarray[Any, Any]) -> np.ndarray[Any, np.dtype[np.float32]]:
    return (labels[:, None] == np.array([int(part) for part in PARTS])).astype(np.float32)
