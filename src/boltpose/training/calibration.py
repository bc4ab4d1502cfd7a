"""Probabilities that mean what they say: one temperature per network, from unseen families."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
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
from boltpose.segmentation.predictor import PARTS
from boltpose.segmentation.reliability import (
    CALIBRATION_FORMAT,
    CalibrationCurve,
    CalibrationRecord,
    NetworkCalibration,
    measure_reliability,
    most_probable,
    scale_probabilities,
)
from boltpose.segmentation.scene import OnnxScenePredictor

_ROWS_PER_CLOUD = 20000
_RANGE = (0.3, 5.0)
MOST_PROBABLE = "the most probable class"
BOLT = "bolt"
MOTOR = "motor"

Rows = tuple[FloatArray, IntArray]
"""Probabilities, (N, C), and classes, (N,), from 0."""


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


def calibrate_models(
    data: Reman18, folder: Path, shipped: Path, report: Path | None = None
) -> Iterator[str]:
    """Set the temperatures of the leave-one-family-out networks and of the shipped ones.

    A family's networks get the temperature fitted on the other families (each labelled by the
    networks that have not seen it), the shipped ones that of all.

    Args:
        data: The labelled motors.
        folder: Holds one folder of networks per family.
        shipped: Folder of the networks trained on all families.
        report: Where to write how well the probabilities hold, JSON; None for nowhere.

    Yields:
        A line per network that tells its temperature, and one on what it does to the errors.
    """
    seen = {family: _held_out(data, folder / family, family) for family in data.families}
    measured: list[NetworkCalibration] = []
    for network, number, statements in (
        (PARTS_FILE, 0, {BOLT: PARTS.index(Part.BOLT)}),
        (SCENE_FILE, 1, {MOTOR: 1}),
    ):
        rows = {family: seen[family][number] for family in data.families}
        temperatures = {
            family: fit_temperature(*_pooled({k: v for k, v in rows.items() if k != family}))
            for family in data.families
        }
        of_all = fit_temperature(*_pooled(rows))
        for family, temperature in temperatures.items():
            set_temperature(folder / family / network, temperature)
            yield f"{folder / family / network}: temperature {temperature:.3f}"
        set_temperature(shipped / network, of_all)
        yield f"{shipped / network}: temperature {of_all:.3f}"
        measured.append(
            NetworkCalibration(
                network=network,
                temperature=of_all,
                temperatures=temperatures,
                curves=measure_curves(rows, temperatures, statements),
            )
        )
        yield f"{network}: {_errors(measured[-1])}"
    if report is not None:
        record = CalibrationRecord(
            format=CALIBRATION_FORMAT, data=data.root.as_posix(), networks=tuple(measured)
        )
        write_calibration(report, record)
        yield f"written: {report}"


def measure_curves(
    rows: Mapping[str, Rows], temperatures: Mapping[str, float], statements: Mapping[str, int]
) -> tuple[CalibrationCurve, ...]:
    """Reliability before and after temperature scaling, families pooled.

    Args:
        rows: By family, uncalibrated probabilities, (N, C), and classes, (N,).
        temperatures: By family, fitted on the others.
        statements: By name, the class whose probability is looked at by itself.

    Returns:
        The curve of the most probable class, then one per entry of `statements`.
    """
    before, classes = _pooled(rows)
    scaled = [
        scale_probabilities(probabilities, temperatures[family])
        for family, (probabilities, _) in rows.items()
    ]
    after = np.concatenate(scaled)
    curves = [
        CalibrationCurve(
            statement=MOST_PROBABLE,
            before=measure_reliability(*most_probable(before, classes)),
            after=measure_reliability(*most_probable(after, classes)),
        )
    ]
    for name, number in statements.items():
        is_class = classes == number
        curves.append(
            CalibrationCurve(
                statement=name,
                before=measure_reliability(before[:, number], is_class),
                after=measure_reliability(after[:, number], is_class),
            )
        )
    return tuple(curves)


def write_calibration(path: Path, record: CalibrationRecord) -> None:
    """Write the record as JSON; `boltpose.evaluation.calibration_tables` renders it."""
    text = json.dumps(asdict(record), indent=1) + "\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)


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


def _pooled(rows: Mapping[str, Rows]) -> Rows:
    found = list(rows.values())
    return (
        np.concatenate([probabilities for probabilities, _ in found]),
        np.concatenate([classes for _, classes in found]),
    )


def _errors(measured: NetworkCalibration) -> str:
    """Expected calibration errors in one line."""
    return "expected calibration error " + ", ".join(
        f"of {curve.statement} {100 * curve.before.expected_error:.2f} -> "
        f"{100 * curve.after.expected_error:.2f} %"
        for curve in measured.curves
    )


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
