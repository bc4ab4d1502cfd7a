"""The main job: one view of a clamped motor + its prior -> every bolt in the robot's frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import BoolArray
from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.relabel import relabel
from boltpose.registration.verify import verify
from boltpose.schema import LocatedBolt, LocateResult, Prior, Scan, Status
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock
from boltpose.view import place_bolts, register_again, register_view, see

__all__ = ["LocateConfig", "locate"]


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

    Pure: reads no file and no global state, so the same input gives the same result bit for bit,
    whatever the order of its points and the number of threads.

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
        view = see(scan, predictor, config)
        stages.done("segmentation")
        best = register_view(view, prepared, config).best
        stages.done("registration")
        if best is not None:
            best = register_again(best, view, prepared, config)
            stages.done("relabelling")
        verdict = verify(best, prepared, view.scene, view.motor_points, config.verification)
        stages.done("verification")
        bolts: tuple[LocatedBolt, ...] = ()
        motor_mask: BoolArray | None = None
        if best is not None and verdict.status is Status.OK:
            bolts = place_bolts(best, view, prepared, base_from_camera, config)
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
