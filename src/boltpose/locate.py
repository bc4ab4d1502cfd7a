"""The main job: one view of a clamped motor + its prior -> every bolt in the robot's frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import ConfigError, DegenerateGeometryError, FrameError
from boltpose.geometry.transforms import Transform
from boltpose.placement import PlacementConfig, place_bolt
from boltpose.registration.config import RegistrationConfig, VerifyConfig, VisibilityConfig
from boltpose.registration.icp import refine_pose
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.register import register
from boltpose.registration.relabel import relabel
from boltpose.registration.scene import build_scene
from boltpose.registration.verify import verify
from boltpose.registration.visibility import see_bolts
from boltpose.schema import LocatedBolt, LocateResult, Prior, Registration, Scan, Status
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock


@dataclass(frozen=True, slots=True, kw_only=True)
class LocateConfig:
    """Settings of every stage between a scan and its poses."""

    max_points: int = 300_000
    """Larger scans are thinned by a stride for segmentation and registration: 2.3 M points are
    then as fast and as accurate as 0.2 M (FINDINGS, section 1, "Budget")."""
    min_motor_probability: float = 0.5
    """Scan points from this probability on are taken for the motor."""
    relabel_mm: float = 1.5
    """After registration the motor is what lies this near to the posed prior; 0 keeps the
    network's labels. Raised 96 to 99.8 % of right labels (FINDINGS, section 2)."""
    label_scan: bool = False
    """Fill `LocateResult.motor_mask`: pictures and reports want it, a robot does not."""
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    verification: VerifyConfig = field(default_factory=VerifyConfig)
    visibility: VisibilityConfig = field(default_factory=VisibilityConfig)
    placement: PlacementConfig = field(default_factory=PlacementConfig)

    def __post_init__(self) -> None:
        if not self.max_points >= 1000:
            raise ConfigError(f"max_points must be >= 1000, got {self.max_points}")
        if not 0 < self.min_motor_probability < 1:
            raise ConfigError(
                f"min_motor_probability must be in (0, 1), got {self.min_motor_probability}"
            )
        if not 0 <= self.relabel_mm < 10:
            raise ConfigError(f"relabel_mm must be in [0, 10), got {self.relabel_mm}")


def locate(
    scan: Scan,
    prior: Prior | PreparedPrior,
    base_from_camera: Transform | None,
    predictor: ScenePredictor,
    config: LocateConfig | None = None,
    *,
    provenance: Mapping[str, Any] | None = None,
    on_stage: OnStage | None = None,
) -> LocateResult:
    """Find every bolt of a clamped motor in the robot's base frame, seen or not.

    Pure: reads no file and no global state, so the same input gives the same result bit for bit.

    Args:
        scan: One view, mm, frame `camera` (camera at the origin, +z forward).
        prior: The motor's prior. Hand in `prepare_prior(prior)` to save its half second on every
            scan but the first.
        base_from_camera: Hand-eye matrix; None leaves the poses in frame `camera`.
        predictor: Scene segmentation (`load_models().scene`).
        config: Settings; defaults if left out.
        provenance: Kept in the result beside version and settings, JSON-ready.
        on_stage: Told each stage's name and wall time.

    Returns:
        All bolts with a verdict `ok`, or no bolts, the reasons and the rejected pose.

    Raises:
        FrameError: `base_from_camera` does not map `camera` to `base`.
        MissingExtraError: The configured method needs a package that is not installed.

    Source:
        LCE 2024 (arXiv 2505.24669), section 3.1; relabelling, verdict and uncertainty are ours.
    """
    config = config or LocateConfig()
    frame = _check_frame(base_from_camera)
    stages = StageClock(on_stage)
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        prepared = prior if isinstance(prior, PreparedPrior) else prepare_prior(prior)
        stages.done("prepare prior")
        points = scan.points[:: max(1, -(-len(scan) // config.max_points))]
        scene = build_scene(points)
        is_motor = _segment(points, predictor, config)
        stages.done("segmentation")
        result = register(prepared, points[is_motor], config.registration, scene=scene)
        stages.done("registration")
        best = result.best
        if best is not None:
            best = _register_again(best, prepared, points, config)
            stages.done("relabelling")
        verdict = verify(best, prepared, scene, points[is_motor], config.verification)
        stages.done("verification")
        bolts: tuple[LocatedBolt, ...] = ()
        motor_mask: BoolArray | None = None
        if best is not None and verdict.status is Status.OK:
            bolts = _place(best, prepared, scan, base_from_camera, config)
            if config.label_scan:
                motor_mask = relabel(
                    prepared,
                    best.camera_from_prior,
                    scan.points,
                    threshold_mm=config.relabel_mm or LocateConfig().relabel_mm,
                )
        stages.done("bolts")
    return LocateResult(
        verdict=verdict,
        frame=frame,
        bolts=bolts,
        registration=best,
        prior_name=prepared.prior.name,
        base_from_camera=base_from_camera,
        motor_mask=motor_mask,
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            **(provenance or {}),
        },
    )


def _check_frame(base_from_camera: Transform | None) -> str:
    if base_from_camera is None:
        return "camera"
    if (base_from_camera.target, base_from_camera.source) != ("base", "camera"):
        raise FrameError(
            f"hand-eye must be base_from_camera, got "
            f"{base_from_camera.target}_from_{base_from_camera.source}"
        )
    return "base"


def _segment(points: FloatArray, predictor: ScenePredictor, config: LocateConfig) -> BoolArray:
    if len(points) < config.registration.min_points:
        return np.zeros(len(points), dtype=np.bool_)
    return np.asarray(predictor.predict(points) >= config.min_motor_probability)


def _register_again(
    best: Registration, prepared: PreparedPrior, points: FloatArray, config: LocateConfig
) -> Registration:
    """Refine on the points that the first pose itself says belong to the motor."""
    if config.relabel_mm == 0 or config.registration.method != "multi_start":
        return best
    is_motor = relabel(prepared, best.camera_from_prior, points, threshold_mm=config.relabel_mm)
    try:
        fine = refine_pose(
            best.camera_from_prior, points[is_motor], prepared, config.registration.fine
        )
    except DegenerateGeometryError:
        return best  # too few points near the prior: the verdict will say so
    return replace(
        best,
        camera_from_prior=fine.camera_from_prior,
        converged=fine.converged,
        rms_mm=fine.rms_mm,
        inlier_ratio=fine.inlier_ratio,
        covariance=fine.covariance,
        centre_mm=fine.centre_mm,
    )


def _place(
    registration: Registration,
    prepared: PreparedPrior,
    scan: Scan,
    base_from_camera: Transform | None,
    config: LocateConfig,
) -> tuple[LocatedBolt, ...]:
    # most of a scan is clamp and table: sort it out before anything is computed on it
    middle = registration.camera_from_prior.apply(prepared.centre_mm)
    near = np.abs(scan.points - middle).max(axis=1) < prepared.radius_mm + 1.0
    sights = see_bolts(
        prepared, registration.camera_from_prior, scan.points[near], config.visibility
    )
    return tuple(
        place_bolt(
            bolt,
            registration,
            base_from_camera,
            visible_fraction=sight.visible_fraction,
            visibility=sight.visibility,
            alignment_sigma_rad=prepared.prior.alignment.axis_sigma_rad,
            config=config.placement,
        )
        for bolt, sight in zip(prepared.prior.bolts, sights, strict=True)
    )
