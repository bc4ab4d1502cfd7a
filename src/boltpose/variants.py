"""The main job where the motor is not known: which of many priors is in the clamp, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from threadpoolctl import threadpool_limits

import boltpose
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.library import PriorLibrary
from boltpose.schema import HandEyeError, LocateResult, Prior, Scan, Status
from boltpose.seen_bolts import Found, find_in_view
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock
from boltpose.variant_search import VariantConfig, VariantSearch
from boltpose.view import frame_of_result, see

__all__ = ["VariantConfig", "locate_variant"]


def locate_variant(
    scan: Scan,
    priors: PriorLibrary | Sequence[Prior],
    base_from_camera: Transform | None,
    predictor: ScenePredictor,
    config: LocateConfig | None = None,
    variants: VariantConfig | None = None,
    *,
    hand_eye_error: HandEyeError | None = None,
    provenance: Mapping[str, Any] | None = None,
    on_stage: OnStage | None = None,
) -> LocateResult:
    """Tell which of the known motors is clamped and find its bolts; refuse all others.

    The motor that looks most alike by its point pairs is registered coarsely. With its axes all
    others are laid into the view at once and ranked; the best goes through the same registration
    and verdict as in `locate`, until one is accepted. Then the nearest look-alikes are settled
    from its pose and measured on the same points: the same family in another size must fit clearly
    worse.

    Args:
        scan: One view, mm, frame `camera` (camera at the origin, +z forward).
        priors: All motors that may be clamped: a library opened once, or priors in memory.
        base_from_camera: Hand-eye matrix; None leaves the poses in frame `camera`.
        predictor: Scene segmentation (`load_models().scene`).
        config: Settings of every stage; defaults if left out.
        variants: When a motor counts as recognised.
        hand_eye_error: How well `base_from_camera` is known; None takes it for exact.
        provenance: Kept in the result beside version and settings, JSON-ready.
        on_stage: Told each stage's name and wall time.

    Returns:
        All bolts of the motor recognised, `variants` telling how the others fit, or no bolts and
        the reasons. `prior_name` and `registration` are then of the best one tried, for diagnosis.

    Raises:
        ConfigError: There is no prior, or a name comes twice.
        FrameError: `base_from_camera` does not map `camera` to `base`.
        InputFileError: A prior's file cannot be read.
    """
    config = config or LocateConfig()
    variants = variants or VariantConfig()
    frame = frame_of_result(base_from_camera)
    stages = StageClock(on_stage)
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        library = priors if isinstance(priors, PriorLibrary) else PriorLibrary.from_priors(priors)
        stages.done("priors")
        view = see(scan, predictor, config)
        stages.done("segmentation")
        search = VariantSearch(view, library, config, variants)
        search.run()
        stages.done("registration")
        search.compare()
        stages.done("look-alikes")
        best, verdict = search.decide()
        found = Found()
        if best.registration is not None and verdict.status is Status.OK:
            found = find_in_view(
                best.registration,
                view,
                library.prepared(best.row),
                base_from_camera,
                config,
                hand_eye_error=hand_eye_error,
            )
        stages.done("bolts")
    return LocateResult(
        verdict=verdict,
        frame=frame,
        bolts=found.bolts,
        registration=best.registration,
        prior_name=library.names[best.row],
        base_from_camera=base_from_camera,
        motor_mask=found.motor_mask,
        extra_heads=found.extra_heads,
        variants=search.scores(best),
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            "variants": {"priors": len(library), **search.names(), **asdict(variants)},
            **(provenance or {}),
        },
    )
