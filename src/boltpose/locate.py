"""The main job: one view of a clamped motor + its prior -> every bolt in the robot's frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from threadpoolctl import threadpool_limits

import boltpose
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.verify import verify
from boltpose.schema import HandEyeError, LocateResult, Prior, Scan, Status
from boltpose.seen_bolts import Found, find_in_view
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock
from boltpose.view import frame_of_result, register_again, register_view, see

__all__ = ["LocateConfig", "locate"]


def locate(
    scan: Scan,
    prior: Prior | PreparedPrior,
    base_from_camera: Transform | None,
    predictor: ScenePredictor,
    config: LocateConfig | None = None,
    *,
    hand_eye_error: HandEyeError | None = None,
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
        hand_eye_error: How well `base_from_camera` is known; it then counts in every sigma. None
            takes it for exact.
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
    frame = frame_of_result(base_from_camera)
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
        found = Found()
        if best is not None and verdict.status is Status.OK:
            found = find_in_view(
                best, view, prepared, base_from_camera, config, hand_eye_error=hand_eye_error
            )
        stages.done("bolts")
    return LocateResult(
        verdict=verdict,
        frame=frame,
        bolts=found.bolts,
        registration=best,
        prior_name=prepared.prior.name,
        base_from_camera=base_from_camera,
        motor_mask=found.motor_mask,
        extra_heads=found.extra_heads,
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            **(provenance or {}),
        },
    )
