"""Full scan -> Prior: segment, align, find the bolts. Once per motor, before production."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import FloatArray, IntArray, UInt8Array
from boltpose.errors import ConfigError, EmptyScanError
from boltpose.geometry.normals import estimate_normals, orient_outward
from boltpose.geometry.transforms import angle_between_rad
from boltpose.prior.alignment import AlignmentConfig, align_motor
from boltpose.prior.find_bolts import FindBoltsConfig, find_bolts
from boltpose.schema import Alignment, Part, Prior, PriorBolt, Scan
from boltpose.segmentation.predictor import PARTS, PartPredictor, PartProbabilities
from boltpose.segmentation.thinning import SPACING_MM, STRAY_RATIO, thin_scan
from boltpose.stages import OnStage, StageClock


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildConfig:
    """How a prior is made from a full scan."""

    use_file_labels: bool = False
    """Take the labels the scan carries (a person's, or a CAD model's named parts) instead of the
    network's. Off by default: labels in a file must not slip in unnoticed."""
    spacing_mm: float = SPACING_MM
    """Point spacing the networks know; denser scans are thinned to it."""
    min_points: int = 5000
    """Fewer cannot show a bolt: a head of 8 mm would get about 5 points of a 300 mm motor."""
    stray_ratio: float = STRAY_RATIO
    """Points whose 4th neighbour is this many times farther than usual are strays, dropped."""
    normal_neighbours: int = 20
    max_axis_disagreement_rad: float = 0.0175
    """The axis from the labelled housing and the label-free one may differ by this, 1 degree; on
    reman18 (simulated) both are within 0.2 degrees of the truth. Beyond it no bolt is sure."""
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    bolts: FindBoltsConfig = field(default_factory=FindBoltsConfig)

    def __post_init__(self) -> None:
        for name in ("spacing_mm", "stray_ratio", "max_axis_disagreement_rad"):
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
    stages = StageClock(on_stage)
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
            parts = _certain(np.asarray(scan.labels)[keep])
        else:
            assert predictor is not None
            parts = predictor.predict(points, normals)
        stages.done("segmentation")
        alignment = align_motor(points, normals, parts.labels, config.alignment)
        stages.done("alignment")
        bolts = find_bolts(points, normals, parts.probabilities, alignment, config.bolts)
        disagreement_rad = _axis_disagreement_rad(alignment, parts)
        if disagreement_rad is not None and disagreement_rad > config.max_axis_disagreement_rad:
            bolts = _doubted(bolts, disagreement_rad)
        stages.done("bolts")
    return Prior(
        name=name,
        points=points,
        normals=normals,
        labels=parts.labels,
        bolts=bolts,
        alignment=alignment,
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            "labels": "file" if config.use_file_labels else "network",
            "axis_disagreement_rad": disagreement_rad,
            **(provenance or {}),
        },
    )


def _thin(points: FloatArray, config: BuildConfig) -> IntArray:
    """Indices of the points to work on: no strays, not denser than the networks know."""
    if len(points) < config.min_points:
        return np.arange(len(points))
    return thin_scan(points, spacing_mm=config.spacing_mm, stray_ratio=config.stray_ratio)


def _as_stored(values: FloatArray) -> FloatArray:
    return values.astype(np.float32).astype(np.float64)


def _certain(labels: UInt8Array) -> PartProbabilities:
    """Labels a person or a CAD model vouches for, as probabilities."""
    is_part = labels[:, None] == np.array([int(part) for part in PARTS])
    return PartProbabilities(probabilities=is_part.astype(np.float32))


def _axis_disagreement_rad(alignment: Alignment, parts: PartProbabilities) -> float | None:
    """Angle between the axis of the labelled housing and the label-free one, if there is one."""
    if parts.frame is None:
        return None
    label_free = parts.frame.canonical_from_prior.inverse().z_axis
    return float(angle_between_rad(alignment.prior_from_motor.z_axis, label_free))


def _doubted(bolts: tuple[PriorBolt, ...], disagreement_rad: float) -> tuple[PriorBolt, ...]:
    remark = f"two ways to find the motor's axis differ by {np.degrees(disagreement_rad):.1f} deg"
    return tuple(
        replace(
            bolt,
            is_sure=False,
            # one of the two ways is wrong
            confidence=min(bolt.confidence, 0.5),
            remarks=(*bolt.remarks, remark),
        )
        for bolt in bolts
    )
