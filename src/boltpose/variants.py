"""The main job where the motor is not known: which of many priors is in the clamp, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import BoolArray
from boltpose.errors import FrameError
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.library import PriorLibrary
from boltpose.registration.relabel import relabel
from boltpose.schema import LocatedBolt, LocateResult, Prior, Scan, Status
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.stages import OnStage, StageClock
from boltpose.variant_search import VariantConfig, VariantSearch
from boltpose.view import place_bolts, see

__all__ = ["VariantConfig", "locate_variant"]


def locate_variant(
    scan: Scan,
    priors: PriorLibrary | Sequence[Prior],
    base_from_camera: Transform | None,
    predictor: ScenePredictor,
    config: LocateConfig | None = None,
    variants: VariantConfig | None = None,
    *,
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
    frame = _check_frame(base_from_camera)
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
        bolts: tuple[LocatedBolt, ...] = ()
        motor_mask: BoolArray | None = None
        if best.registration is not None and verdict.status is Status.OK:
            prepared = library.prepared(best.row)
            bolts = place_bolts(best.registration, view, prepared, base_from_camera, config)
            if config.label_scan:
                motor_mask = relabel(
                    prepared,
                    best.registration.camera_from_prior,
                    scan.points,
                    threshold_mm=config.relabel_mm or LocateConfig().relabel_mm,
                )
        stages.done("bolts")
    return LocateResult(
        verdict=verdict,
        frame=frame,
        bolts=bolts,
        registration=best.registration,
        prior_name=library.names[best.row],
        base_from_camera=base_from_camera,
        motor_mask=motor_mask,
        variants=search.scores(best),
        provenance={
            "version": boltpose.__version__,
            "config": asdict(config),
            "variants": {"priors": len(library), **search.names(), **asdict(variants)},
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
