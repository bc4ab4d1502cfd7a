from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boltpose.evaluation.calibration_report import report_calibration
from boltpose.evaluation.calibration_tables import read_calibration
from boltpose.segmentation.reliability import (
    CALIBRATION_FORMAT,
    CalibrationRecord,
    NetworkCalibration,
)
from boltpose.training.calibration import (
    BOLT,
    MOST_PROBABLE,
    fit_temperature,
    measure_curves,
    write_calibration,
)


@pytest.mark.parametrize("truth", [0.6, 1.0, 2.0])
def test_the_temperature_that_spoilt_probabilities_is_found(truth: float) -> None:
    rng = np.random.default_rng(0)
    logits = 1.5 * rng.normal(size=(20000, 4))
    right = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    classes = (right.cumsum(axis=1) < rng.random((20000, 1))).sum(axis=1)
    spoilt = right**truth / (right**truth).sum(axis=1, keepdims=True)
    assert fit_temperature(spoilt, classes) == pytest.approx(truth, rel=0.05)


def _rows(seed: int, spoil: float) -> tuple[np.ndarray, np.ndarray]:
    """Classes drawn from probabilities, and the probabilities overstated by a power."""
    rng = np.random.default_rng(seed)
    logits = 1.5 * rng.normal(size=(20000, 6))
    right = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    classes = (right.cumsum(axis=1) < rng.random((20000, 1))).sum(axis=1)
    return right**spoil / (right**spoil).sum(axis=1, keepdims=True), classes


def test_the_temperature_of_other_families_mends_the_expected_error() -> None:
    rows = {"a": _rows(0, 2.0), "b": _rows(1, 2.0)}
    temperatures = {"a": fit_temperature(*rows["b"]), "b": fit_temperature(*rows["a"])}
    curves = measure_curves(rows, temperatures, {BOLT: 5})

    assert [curve.statement for curve in curves] == [MOST_PROBABLE, BOLT]
    for curve in curves:
        assert curve.before.count == curve.after.count == 40000
        assert curve.before.expected_error > 0.04
        assert curve.after.expected_error < 0.01
        assert curve.after.brier < curve.before.brier


def test_evaluation_reads_and_renders_what_calibrate_wrote(tmp_path: Path) -> None:
    rows = {"a": _rows(0, 2.0)}
    record = CalibrationRecord(
        format=CALIBRATION_FORMAT,
        data="data/reman18",
        networks=(
            NetworkCalibration(
                network="parts.onnx",
                temperature=2.0,
                temperatures={"a": 2.0},
                curves=measure_curves(rows, {"a": 2.0}, {BOLT: 5}),
            ),
        ),
    )
    write_calibration(tmp_path / "calibration.json", record)
    assert read_calibration(tmp_path / "calibration.json") == record

    (tmp_path / "docs").mkdir()
    priors, text = report_calibration(tmp_path, tmp_path / "docs" / "results.md")
    assert priors == ""
    after = 100 * record.networks[0].curves[1].after.expected_error
    assert "| parts.onnx | bolt | 20000 | " in text
    assert f"{after:.2f} %" in text
    picture = tmp_path / "docs" / "images" / "calibration.png"
    first = picture.read_bytes()
    assert first.startswith(b"\x89PNG")
    report_calibration(tmp_path, tmp_path / "docs" / "results.md")
    assert picture.read_bytes() == first


def test_nothing_measured_gives_no_section_and_no_picture(tmp_path: Path) -> None:
    assert report_calibration(tmp_path, tmp_path / "results.md") == ("", "")
    assert list(tmp_path.iterdir()) == []
