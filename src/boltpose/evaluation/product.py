"""The pipeline as users call it."""

from __future__ import annotations

from pathlib import Path

from boltpose.evaluation.pipeline import OnStage, Pipeline
from boltpose.geometry.transforms import Transform
from boltpose.io.hand_eye import read_hand_eye
from boltpose.io.scan import read_scan
from boltpose.locate import LocateConfig, locate
from boltpose.prior.build import build_prior
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.schema import LocateResult, Prior, Scan
from boltpose.segmentation.models import Models, load_models


def boltpose_pipeline() -> Pipeline[Models]:
    """Return the shipped functions with their shipped settings."""
    return Pipeline(
        load_models=_load_models,
        read_scan=_read_scan,
        read_hand_eye=_read_hand_eye,
        build_prior=_build_prior,
        prepare=prepare_prior,
        locate=_locate,
    )


def _load_models(folder: Path) -> Models:
    return load_models(folder)


def _read_scan(path: Path) -> Scan:
    return read_scan(path)


def _read_hand_eye(path: Path) -> Transform:
    return read_hand_eye(path).transform


def _build_prior(scan: Scan, models: Models, name: str, on_stage: OnStage) -> Prior:
    return build_prior(scan, models.parts, name=name, on_stage=on_stage)


def _locate(
    scan: Scan,
    prior: Prior | PreparedPrior,
    base_from_camera: Transform,
    models: Models,
    on_stage: OnStage,
) -> LocateResult:
    # as with --picture, which shows the scan's labels too: they are compared with the truth
    config = LocateConfig(label_scan=True)
    return locate(scan, prior, base_from_camera, models.scene, config, on_stage=on_stage)
