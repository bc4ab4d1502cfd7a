"""Probabilities that mean what they say: one temperature per network, from unseen families."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import onnx
from scipy.optimize import minimize_scalar

from boltpose.arrays import Float32Array, FloatArray, IntArray
from boltpose.datasets.part_clouds import scan_normals
from boltpose.datasets.reman18 import Reman18
from boltpose.io.atomic import write_atomic
from boltpose.schema import Part
from boltpose.segmentation.models import PARTS_FILE, PARTS_LOCAL_FILE, SCENE_FILE, SCENE_LOCAL_FILE
from boltpose.segmentation.parts import OnnxPartPredictor
from boltpose.segmentation.scene import OnnxScenePredictor

_ROWS_PER_CLOUD = 20000
_RANGE = (0.3, 5.0)


def fit_temperature(probabilities: FloatArray, classes: IntArray) -> float:
    """Find the temperature that makes probabilities, (N, C), most likely for classes, (N,).

    Source:
        Guo et al., ICML 2017, section 4.2.
    """
    logits = np.log(np.maximum(probabilities, 1e-7))
    rows = np.arange(len(classes))

    def loss(temperature: float) -> float:
        scaled = logits / temperature
        scaled = scaled - scaled.max(axis=1, keepdims=True)
        normaliser = np.log(np.exp(scaled).sum(axis=1))
        return float(np.mean(normaliser - scaled[rows, classes]))

    found: Any = minimize_scalar(loss, bounds=_RANGE, method="bounded")
    return float(found.x)


def calibrate_models(data: Reman18, folder: Path, shipped: Path) -> Iterator[str]:
    """Set the temperatures of the leave-one-family-out networks and of the shipped ones.

    A family's networks get the temperature fitted on the other families (each labelled by the
    networks that have not seen it), the shipped ones that of all.

    Args:
        data: The labelled motors.
        folder: Holds one folder of networks per family.
        shipped: Folder of the networks trained on all families.

    Yields:
        A line per network that tells its temperature.
    """
    seen = {family: _held_out(data, folder / family, family) for family in data.families}
    for network, number in ((PARTS_FILE, 0), (SCENE_FILE, 1)):
        for family in (*data.families, None):
            others = [seen[name][number] for name in data.families if name != family]
            temperature = fit_temperature(
                np.concatenate([probabilities for probabilities, _ in others]),
                np.concatenate([classes for _, classes in others]),
            )
            place = shipped if family is None else folder / family
            set_temperature(place / network, temperature)
            yield f"{place / network}: temperature {temperature:.3f}"


def set_temperature(path: Path, temperature: float) -> None:
    """Store the temperature in a network's metadata."""
    model = onnx.load(path)
    for entry in model.metadata_props:
        if entry.key == "boltpose.settings":
            settings = json.loads(entry.value)
            settings["temperature"] = round(temperature, 4)
            entry.value = json.dumps(settings, sort_keys=True)

    def write(stream: BinaryIO) -> None:
        stream.write(model.SerializeToString())

    write_atomic(path, write)


Rows = tuple[FloatArray, IntArray]


def _held_out(data: Reman18, folder: Path, family: str) -> tuple[Rows, Rows]:
    """Uncalibrated probabilities and classes of some points of a family's scans and views."""
    for name in (PARTS_FILE, SCENE_FILE):
        set_temperature(folder / name, 1.0)
    parts = OnnxPartPredictor(folder / PARTS_LOCAL_FILE, folder / PARTS_FILE)
    scene = OnnxScenePredictor(folder / SCENE_LOCAL_FILE, folder / SCENE_FILE)
    part_rows: list[tuple[Float32Array, IntArray]] = []
    scene_rows: list[tuple[Float32Array, IntArray]] = []
    rng = np.random.default_rng(0)
    for motor in data.motors_of(family):
        scan = data.full_scan(motor)
        pick = rng.permutation(len(scan.labels))[:_ROWS_PER_CLOUD]
        found = parts.predict(scan.points, scan_normals(scan.points)).probabilities[pick]
        part_rows.append((found, scan.labels[pick].astype(np.int64) - 1))
        for number in range(data.view_count(motor)):
            view = data.view(motor, number)
            pick = rng.permutation(len(view.labels))[:_ROWS_PER_CLOUD]
            motor_probability = scene.predict(view.points)[pick]
            scene_rows.append(
                (
                    np.stack([1 - motor_probability, motor_probability], axis=1),
                    (view.labels[pick] != Part.BACKGROUND).astype(np.int64),
                )
            )
    return _joined(part_rows), _joined(scene_rows)


def _joined(rows: list[tuple[Float32Array, IntArray]]) -> Rows:
    probabilities = np.concatenate([found for found, _ in rows]).astype(np.float64)
    return probabilities, np.concatenate([classes for _, classes in rows])
