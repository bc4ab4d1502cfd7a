"""The views that every method is given: the same points, the same masks, the truth beside them."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import InputFileError
from boltpose.evaluation.peers_records import Mask
from boltpose.evaluation.reman18 import TrueMotor, TrueView, read_pixel_labels
from boltpose.geometry.sampling import canonical_rows
from boltpose.io.atomic import write_atomic
from boltpose.io.scan import read_scan
from boltpose.locate_config import LocateConfig
from boltpose.registration.scene import build_scene
from boltpose.segmentation.models import load_models
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.view import View

CLAMP_SHARE = 0.2
"""Share of all points in mask `CLAMP20` that are the clamp's."""


def read_view(view: TrueView) -> View:
    """Read a view as `locate` sees it, its true motor points marked.

    Raises:
        InputFileError: An image cannot be read.
    """
    scan = read_scan(view.depth_path)
    if scan.pixels is None:
        raise InputFileError(view.depth_path, "no pixels", "a depth image")
    rows = canonical_rows(scan.points, LocateConfig().max_points)
    points = scan.points[rows]
    is_motor = read_pixel_labels(view, scan.pixels[rows]) > 0
    return View(scan=scan, points=points, is_motor=is_motor, scene=build_scene(points))


def with_mask(
    view: View, mask: Mask, motor: TrueMotor, index: int, models: Path, cache: Path
) -> View:
    """Put a mask in the place of the true one.

    Args:
        view: With its true mask.
        mask: Which one.
        motor: The motor.
        index: Number of the view; with the motor's it seeds what is random.
        models: Folder of the networks that have not seen the motor's family.
        cache: Folder where masks by networks are kept.

    Raises:
        InputFileError: The networks cannot be read.
    """
    if mask is Mask.CLAMP20:
        rng = np.random.default_rng([index, 3, motor.number])
        return replace(view, is_motor=add_clamp(view.points, view.is_motor, rng))
    path = cache / f"{motor.name}_{index}_{_digest(models)}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as file:
            is_motor = np.unpackbits(file["bits"], count=len(view.points)).astype(np.bool_)
    else:
        found = _predictor(models).predict(view.points)
        is_motor = np.asarray(found >= LocateConfig().min_motor_probability)
        _write_mask(path, is_motor)
    return replace(view, is_motor=is_motor)


def add_clamp(points: FloatArray, is_motor: BoolArray, rng: np.random.Generator) -> BoolArray:
    """Add one patch of other points to a mask until they are a fifth of it.

    Args:
        points: Shape (N, 3), mm.
        is_motor: Shape (N,): the true mask.
        rng: Chooses where the patch is.

    Returns:
        Shape (N,): the worse mask.
    """
    others = np.flatnonzero(~is_motor)
    wanted = round(int(is_motor.sum()) * CLAMP_SHARE / (1 - CLAMP_SHARE))
    seed = points[others[rng.integers(len(others))]]
    distance = np.linalg.norm(points[others] - seed, axis=1)
    nearest = np.argsort(distance, kind="stable")[:wanted]
    spoiled = is_motor.copy()
    spoiled[others[nearest]] = True
    return spoiled


def _write_mask(path: Path, is_motor: BoolArray) -> None:
    def write(stream: BinaryIO) -> None:
        np.savez_compressed(stream, bits=np.packbits(is_motor))

    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, write)


@lru_cache(maxsize=1)
def _predictor(models: Path) -> ScenePredictor:
    return load_models(models).scene


@lru_cache(maxsize=32)
def _digest(models: Path) -> str:
    """Hash the networks of a folder, so that masks of older ones are not taken for theirs."""
    digest = hashlib.sha256()
    for path in sorted(models.glob("scene*.onnx")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:8]
