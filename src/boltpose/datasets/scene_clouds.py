"""Views with their features, computed once and kept on disk."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from boltpose.arrays import Float32Array, IntArray
from boltpose.datasets.labelled_motors import LabelledCloud, LabelledMotors
from boltpose.schema import Part
from boltpose.segmentation.scene_features import (
    SCENE_CONFIG,
    SCENE_WIDTH,
    VOXEL_MM,
    SceneFeatures,
    compute_scene_features,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SceneCloud:
    """A view ready for the scene network."""

    motor: str
    family: str
    view: int
    described: SceneFeatures
    """One row per voxel; its `voxel` is not kept."""
    motor_share: Float32Array
    """Shape (G,), share of the voxel's points that lie on the motor."""
    counts: IntArray
    """Shape (G,), points of every voxel."""


def build_scene_cloud(motor: str, family: str, number: int, view: LabelledCloud) -> SceneCloud:
    """Describe one view."""
    described = compute_scene_features(view.points)
    counts = np.bincount(described.voxel)
    on_motor = np.bincount(described.voxel, weights=view.labels != Part.BACKGROUND)
    return SceneCloud(
        motor=motor,
        family=family,
        view=number,
        described=replace(described, voxel=np.zeros(0, dtype=np.int64)),
        motor_share=(on_motor / counts).astype(np.float32),
        counts=counts.astype(np.int64),
    )


def load_scene_clouds(
    data: LabelledMotors,
    cache: Path,
    *,
    workers: int = 1,
    on_view: Callable[[], None] = lambda: None,
) -> tuple[SceneCloud, ...]:
    """All views of all motors; described on the first call, read from `cache` afterwards.

    Args:
        data: The motors.
        cache: Folder for one file per view; the files' names change with the settings.
        workers: Processes that describe views; the result does not depend on it.
        on_view: Called once for every view whose file is there.
    """
    described = json.dumps([asdict(SCENE_CONFIG), 2, SCENE_WIDTH, VOXEL_MM], sort_keys=True)
    key = hashlib.sha256(described.encode()).hexdigest()[:12]
    cache.mkdir(parents=True, exist_ok=True)
    tasks = [
        (data, motor, number, cache / f"{motor}_{number}_{key}.npz")
        for motor in data.motors
        for number in range(data.view_count(motor))
    ]
    clouds: list[SceneCloud] = []
    with contextlib.ExitStack() as stack:
        if workers > 1:
            context = multiprocessing.get_context("spawn")
            pool = stack.enter_context(ProcessPoolExecutor(workers, mp_context=context))
            results = pool.map(_describe_view, *zip(*tasks, strict=True))
        else:
            results = itertools.starmap(_describe_view, tasks)
        for (_, motor, number, _), path in zip(tasks, results, strict=True):
            clouds.append(_read_scene_cloud(path, motor, data.family(motor), number))
            on_view()
    return tuple(clouds)


def _describe_view(data: LabelledMotors, motor: str, number: int, path: Path) -> Path:
    """Make one view's file unless it is there."""
    if not path.exists():
        view = data.view(motor, number)
        cloud = build_scene_cloud(motor, data.family(motor), number, view)
        temporary = path.with_suffix(".tmp.npz")
        np.savez(
            temporary,
            allow_pickle=False,
            points=cloud.described.points,
            features=cloud.described.features,
            motor_share=cloud.motor_share,
            counts=cloud.counts,
        )
        temporary.replace(path)
    return path


def _read_scene_cloud(path: Path, motor: str, family: str, number: int) -> SceneCloud:
    with np.load(path, allow_pickle=False) as file:
        return SceneCloud(
            motor=motor,
            family=family,
            view=number,
            described=SceneFeatures(
                points=file["points"],
                features=file["features"],
                voxel=np.zeros(0, dtype=np.int64),
            ),
            motor_share=file["motor_share"],
            counts=file["counts"],
        )
