"""Whole training runs: train, export, score on the family left out, write the results down."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from lightning_fabric import Fabric

from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.datasets.part_clouds import scan_normals
from boltpose.io.atomic import write_atomic
from boltpose.schema import Part
from boltpose.segmentation.models import (
    PARTS_FILE,
    PARTS_LOCAL_FILE,
    SCENE_FILE,
    SCENE_LOCAL_FILE,
    load_models,
)
from boltpose.segmentation.part_features import (
    CONTEXT_RADII_MM,
    FEATURE_CONFIG,
    FEATURE_WIDTH,
    INPUT_WIDTH,
)
from boltpose.segmentation.parts import OnnxPartPredictor
from boltpose.segmentation.predictor import PARTS, PartPredictor, ScenePredictor
from boltpose.segmentation.scene import OnnxScenePredictor
from boltpose.segmentation.scene_features import CONTEXT_RADII_MM as SCENE_CONTEXT_RADII_MM
from boltpose.segmentation.scene_features import (
    LOCAL_COLUMNS,
    SCENE_CONFIG,
    SCENE_INPUT_WIDTH,
    VOXEL_MM,
)
from boltpose.training.export import export_onnx, round_to_half
from boltpose.training.hardware import prepare_torch
from boltpose.training.loop import Progress
from boltpose.training.parts import (
    PARTS_LOCAL_WEIGHTS,
    PARTS_WEIGHTS,
    PartNetworks,
    PartsConfig,
    train_parts,
)
from boltpose.training.run_folder import claim_run
from boltpose.training.scene import (
    SCENE_LOCAL_WEIGHTS,
    SCENE_WEIGHTS,
    SceneConfig,
    SceneNetworks,
    train_scene,
)
from boltpose.training.scores import SegmentationScores, confusion_matrix, score_confusion
from boltpose.training.weights import read_weights, save_weights

METRICS_FILE = "metrics.json"


def _no_progress(what: str, step: int, steps: int, loss: float) -> None:
    """Report nothing."""


def describe_run(
    data: LabelledMotors,
    leave_out: str | None,
    recipe: Mapping[str, object],
    start: Path | None,
) -> dict[str, object]:
    """What decides the weights of a run, JSON-ready; `start` is the file it started from."""
    return {
        "data": data.root.name,
        "motors": [m for m in data.motors if data.family(m) != leave_out],
        "leave_out": leave_out,
        "recipe": dict(recipe),
        "pretrained": None if start is None else read_weights(start).sha256,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceRun:
    """One training of both stages, and what it is scored on."""

    data: LabelledMotors
    leave_out: str | None
    """Family not to be seen; None for all."""
    cache: Path
    """Folder for features."""
    out: Path
    """Run folder: weights (.safetensors), both stages as ONNX, and metrics.json."""
    test: LabelledMotors | None = None
    """Another data set to score on, all of it, instead of the family left out."""
    pretrained: Path | None = None
    """Run folder of networks to start from."""
    fabric: Fabric | None = None
    """Launched hardware; one process on one processor by default. The first process writes."""
    workers: int = 1
    """Processes that compute features; the networks do not depend on it."""
    on_progress: Progress = _no_progress

    @property
    def is_first(self) -> bool:
        """Whether this is the process that writes files."""
        return self.fabric is None or self.fabric.is_global_zero


def train_part_models(
    run: EvidenceRun, config: PartsConfig | None = None
) -> SegmentationScores | None:
    """Train the part networks and write them as ONNX; a finished run is scored anew.

    Args:
        run: On what and where.
        config: The recipe.

    Returns:
        Scores on what was held out, through the exported networks; None if nothing was, or in
        all processes but the first.
    """
    recipe = config or PartsConfig()
    return _train_and_score(
        run,
        "parts",
        recipe,
        (PARTS_LOCAL_WEIGHTS, PARTS_WEIGHTS),
        train=lambda: train_parts(
            run.data,
            run.leave_out,
            run.cache,
            recipe,
            run=run.out,
            pretrained=run.pretrained,
            fabric=run.fabric,
            workers=run.workers,
            on_progress=run.on_progress,
        ),
        export=lambda networks: _export_parts(networks, run.out, recipe, run.leave_out),
        score=lambda data, motors: score_parts(
            OnnxPartPredictor(run.out / PARTS_LOCAL_FILE, run.out / PARTS_FILE), data, motors
        ),
    )


def train_scene_model(
    run: EvidenceRun, config: SceneConfig | None = None
) -> SegmentationScores | None:
    """Train the scene networks and write them as ONNX; as `train_part_models`."""
    recipe = config or SceneConfig()
    return _train_and_score(
        run,
        "scene",
        recipe,
        (SCENE_LOCAL_WEIGHTS, SCENE_WEIGHTS),
        train=lambda: train_scene(
            run.data,
            run.leave_out,
            run.cache,
            recipe,
            run=run.out,
            pretrained=run.pretrained,
            fabric=run.fabric,
            workers=run.workers,
            on_progress=run.on_progress,
        ),
        export=lambda networks: _export_scene(networks, run.out, recipe, run.leave_out),
        score=lambda data, motors: score_scene(
            OnnxScenePredictor(run.out / SCENE_LOCAL_FILE, run.out / SCENE_FILE), data, motors
        ),
    )


Networks = TypeVar("Networks", PartNetworks, SceneNetworks)


def _train_and_score(
    run: EvidenceRun,
    task: str,
    recipe: PartsConfig | SceneConfig,
    files: tuple[str, str],
    *,
    train: Callable[[], Networks],
    export: Callable[[Networks], None],
    score: Callable[[LabelledMotors, tuple[str, ...]], SegmentationScores],
) -> SegmentationScores | None:
    """What both tasks have in common; `files` are the weights of both stages."""
    prepare_torch()
    local, context = (run.out / name for name in files)
    start = None if run.pretrained is None else run.pretrained / context.name
    settings = describe_run(run.data, run.leave_out, recipe.describe(), start)
    if run.is_first:
        claim_run(run.out, {"task": task, "inputs": "evidence", **settings})
    if not context.exists():
        networks = train()
        if run.is_first:
            export(networks)
            # last: the mark of a finished run
            save_weights(local, networks.local, settings)
            save_weights(context, networks.context, settings)
    if not run.is_first:
        return None
    held_out = _held_out(run.data, run.leave_out, run.test)
    if held_out is None:
        return None
    scores = score(*held_out)
    write_metrics(run.out, task, scores, recipe.describe())
    return scores


def _export_parts(
    networks: PartNetworks, out: Path, recipe: PartsConfig, leave_out: str | None
) -> None:
    """Write both stages as ONNX, rounded to 16 bits; the networks themselves stay as they are."""
    local, context = deepcopy(networks.local), deepcopy(networks.context)
    round_to_half(local)
    round_to_half(context)
    export_onnx(
        local,
        out / PARTS_LOCAL_FILE,
        kind="parts_local",
        settings={
            "inputs": FEATURE_WIDTH,
            "radii_mm": list(FEATURE_CONFIG.radii_mm),
            "leave_out": leave_out,
        },
        sample_shape=(64, FEATURE_WIDTH),
    )
    export_onnx(
        context,
        out / PARTS_FILE,
        kind="parts",
        settings={
            "inputs": INPUT_WIDTH,
            "context_radii_mm": list(CONTEXT_RADII_MM),
            "sub_cloud": recipe.sub_cloud,
            "local_weight": recipe.local_weight,
            "leave_out": leave_out,
        },
        sample_shape=(2, 256, INPUT_WIDTH),
    )


def _export_scene(
    networks: SceneNetworks, out: Path, recipe: SceneConfig, leave_out: str | None
) -> None:
    """Write both stages as ONNX, rounded to 16 bits; the networks themselves stay as they are."""
    local, context = deepcopy(networks.local), deepcopy(networks.context)
    round_to_half(local)
    round_to_half(context)
    export_onnx(
        local,
        out / SCENE_LOCAL_FILE,
        kind="scene_local",
        settings={
            "inputs": len(LOCAL_COLUMNS),
            "radii_mm": list(SCENE_CONFIG.radii_mm),
            "voxel_mm": VOXEL_MM,
            "leave_out": leave_out,
        },
        sample_shape=(64, len(LOCAL_COLUMNS)),
    )
    export_onnx(
        context,
        out / SCENE_FILE,
        kind="scene",
        settings={
            "inputs": SCENE_INPUT_WIDTH,
            "context_radii_mm": list(SCENE_CONTEXT_RADII_MM),
            "sub_cloud": recipe.sub_cloud,
            "local_weight": recipe.local_weight,
            "leave_out": leave_out,
        },
        sample_shape=(2, 256, SCENE_INPUT_WIDTH),
    )


def _held_out(
    data: LabelledMotors, leave_out: str | None, test: LabelledMotors | None
) -> tuple[LabelledMotors, tuple[str, ...]] | None:
    """What to score on: a data set and its motors."""
    if test is not None:
        return test, test.motors
    return None if leave_out is None else (data, data.motors_of(leave_out))


def rescore_models(
    data: LabelledMotors, folder: Path
) -> Iterator[tuple[str, str, SegmentationScores]]:
    """Score the networks of every family left out anew and write their metrics.json.

    Args:
        data: The labelled motors.
        folder: Holds one folder of networks per family.

    Yields:
        `parts` or `scene`, the family and the scores.
    """
    for family in data.families:
        models = load_models(folder / family)
        motors = data.motors_of(family)
        parts = score_parts(models.parts, data, motors)
        write_metrics(folder / family, "parts", parts)
        yield "parts", family, parts
        scene = score_scene(models.scene, data, motors)
        write_metrics(folder / family, "scene", scene)
        yield "scene", family, scene


def score_parts(
    predictor: PartPredictor, data: LabelledMotors, motors: tuple[str, ...]
) -> SegmentationScores:
    """Score a part predictor on full scans; all points are pooled."""
    confusion = np.zeros((len(PARTS), len(PARTS)), dtype=np.int64)
    for motor in motors:
        scan = data.full_scan(motor)
        guess = predictor.predict(scan.points, scan_normals(scan.points)).labels
        confusion += confusion_matrix(scan.labels - 1, guess - 1, len(PARTS))
    return score_confusion(confusion, [part.name.lower() for part in PARTS])


def score_scene(
    predictor: ScenePredictor, data: LabelledMotors, motors: tuple[str, ...]
) -> SegmentationScores:
    """Score a scene predictor on all views of motors; all points are pooled."""
    confusion = np.zeros((2, 2), dtype=np.int64)
    for motor in motors:
        for number in range(data.view_count(motor)):
            view = data.view(motor, number)
            guess = predictor.predict(view.points) > 0.5
            confusion += confusion_matrix(view.labels != Part.BACKGROUND, guess, 2)
    return score_confusion(confusion, ["background", "motor"])


def write_metrics(
    folder: Path,
    network: str,
    scores: SegmentationScores,
    recipe: Mapping[str, Any] | None = None,
) -> None:
    """Add the scores of a network to the folder's metrics.json; without a recipe keep the old."""
    path = folder / METRICS_FILE
    known: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    kept = known.get(network, {}).get("recipe", {}) if recipe is None else dict(recipe)
    known[network] = {"held_out": scores.to_json(), "recipe": kept}
    text = json.dumps(known, indent=1, sort_keys=True) + "\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)
