"""Which of the library's three calls a command line means."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from boltpose.cli.locate_inputs import ShotFiles
from boltpose.errors import ConfigError
from boltpose.io.digest import sha256_of
from boltpose.locate_config import LocateConfig
from boltpose.prior.file import read_prior
from boltpose.schema import LocateResult, Prior, Scan
from boltpose.segmentation.predictor import ScenePredictor


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LocateCall:
    """A result, and the scan and prior that belong to its `registration`."""

    result: LocateResult
    scan: Scan
    prior: Prior


def call_locate(
    shots: Sequence[ShotFiles],
    prior: Path,
    predictor: ScenePredictor,
    config: LocateConfig,
    provenance: Mapping[str, Any],
    on_stage: Callable[[str, float], None],
) -> LocateCall:
    """Locate with one prior and one scan, with a folder of priors, or with several scans.

    Raises:
        InputFileError: The prior, or one of the folder, cannot be used.
        ConfigError: Several scans and a folder of priors, or a scan without its camera pose.
    """
    if prior.is_dir():
        if len(shots) > 1:
            raise ConfigError(
                f"{prior} is a folder of priors: with several scans name the motor's .prior.npz"
            )
        return _among_many(shots[0], prior, predictor, config, provenance, on_stage)
    known = read_prior(prior)
    if len(shots) == 1:
        from boltpose.locate import locate

        result = locate(
            shots[0].scan,
            known,
            shots[0].base_from_camera,
            predictor,
            config,
            hand_eye_error=shots[0].hand_eye_error,
            provenance=provenance,
            on_stage=on_stage,
        )
        return LocateCall(result=result, scan=shots[0].scan, prior=known)
    from boltpose.locate_views import Shot, locate_views

    views = [
        Shot(
            scan=shot.scan,
            base_from_camera=shot.base_from_camera,
            hand_eye_error=shot.hand_eye_error,
        )
        for shot in shots
        if shot.base_from_camera is not None
    ]
    result = locate_views(views, known, predictor, config, provenance=provenance, on_stage=on_stage)
    reference = result.provenance["reference_view"]
    scan = next((shot.scan for shot in shots if shot.scan.source == reference), shots[0].scan)
    return LocateCall(result=result, scan=scan, prior=known)


def _among_many(
    shot: ShotFiles,
    folder: Path,
    predictor: ScenePredictor,
    config: LocateConfig,
    provenance: Mapping[str, Any],
    on_stage: Callable[[str, float], None],
) -> LocateCall:
    from boltpose.prior.folder import open_prior_folder
    from boltpose.registration.library import PriorLibrary
    from boltpose.variants import locate_variant

    shelf = open_prior_folder(folder)
    result = locate_variant(
        shot.scan,
        PriorLibrary(shelf.sketches, shelf.read),
        shot.base_from_camera,
        predictor,
        config,
        hand_eye_error=shot.hand_eye_error,
        provenance=provenance,
        on_stage=on_stage,
    )
    # the folder has no hash, the motor that was found has one
    about = {**result.provenance, "prior_sha256": sha256_of(shelf.paths[result.prior_name])}
    return LocateCall(
        result=replace(result, provenance=about),
        scan=shot.scan,
        prior=shelf.read(result.prior_name),
    )
