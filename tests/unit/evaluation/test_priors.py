from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from boltpose.errors import ConfigError, EmptyScanError, InputFileError
from boltpose.evaluation.pipeline import Pipeline
from boltpose.evaluation.prior_tables import priors_summary, render_priors
from boltpose.evaluation.priors import (
    confidence_reliability,
    evaluate_priors,
    read_priors,
    score_priors,
    write_priors,
)
from boltpose.geometry.transforms import Transform
from boltpose.schema import Prior, PriorBolt, Scan
from tests.unit.evaluation.records import TOPS, perfect_prior
from tests.unit.evaluation.tiny_reman18 import FAMILIES, tiny_pipeline, write_tiny_reman18

BOLTS = len(TOPS)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return write_tiny_reman18(tmp_path / "tiny")


@pytest.fixture
def leave_out(tmp_path: Path) -> Path:
    for family in set(FAMILIES.values()):
        (tmp_path / "models" / "leave_family_out" / family).mkdir(parents=True)
    return tmp_path / "models"


@pytest.fixture
def one_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "zero_shot"
    folder.mkdir()
    (folder / "parts.onnx").write_bytes(b"for all")
    return folder


def moved(bolt: PriorBolt, step_mm: tuple[float, float, float]) -> PriorBolt:
    matrix = bolt.prior_from_bolt.matrix.copy()
    matrix[:3, 3] += step_mm
    return replace(bolt, prior_from_bolt=Transform("prior", "bolt", matrix))


def pipeline_of(root: Path, change: Any) -> Pipeline[str]:
    def build(_scan: Scan, _models: str, name: str, _on_stage: Any) -> Prior:
        prior = perfect_prior(name)
        return replace(prior, bolts=tuple(change(prior.bolts)))

    return replace(tiny_pipeline(root), build_prior=build)


def test_perfect_priors_score_full_by_networks_that_saw_none_of_the_family(
    data: Path, leave_out: Path, tmp_path: Path
) -> None:
    record = evaluate_priors(data, leave_out, pipeline=tiny_pipeline(data))

    scores = score_priors(record)
    assert record.is_leave_out
    assert [motor.motor for motor in record.motors] == sorted(FAMILIES)
    assert (scores.recall, scores.precision) == (1.0, 1.0)
    assert (scores.sure_false, scores.sure_misplaced, scores.wrong_side) == (0, 0, 0)
    write_priors(tmp_path / "priors.json", record)
    assert read_priors(tmp_path / "priors.json") == record


def test_views_are_not_needed(data: Path, leave_out: Path) -> None:
    for path in data.glob("motor_*/scene_camera.json"):
        path.unlink()
    record = evaluate_priors(data, leave_out, motors=["motor_001"], pipeline=tiny_pipeline(data))
    assert score_priors(record).found == BOLTS


def test_one_folder_of_networks_serves_all_motors(data: Path, one_folder: Path) -> None:
    loaded: list[Path] = []
    plain = pipeline_of(data, tuple)

    def load(folder: Path) -> str:
        loaded.append(folder)
        return folder.name

    record = evaluate_priors(data, one_folder, pipeline=replace(plain, load_models=load))
    assert not record.is_leave_out
    assert loaded == [one_folder]


def test_misses_inventions_and_bad_places_are_counted_and_named(
    data: Path, one_folder: Path
) -> None:
    def spoil(bolts: tuple[PriorBolt, ...]) -> tuple[PriorBolt, ...]:
        invented = replace(moved(bolts[0], (0.0, 0.0, 90.0)), id="X1", is_sure=True, confidence=0.9)
        shifted = replace(moved(bolts[1], (0.8, 0.0, 0.0)), is_sure=True, confidence=0.6)
        return (invented, shifted, *bolts[2:])

    record = evaluate_priors(
        data, one_folder, motors=["motor_000"], pipeline=pipeline_of(data, spoil)
    )
    scores = score_priors(record)
    assert (scores.true_bolts, scores.found, scores.false) == (BOLTS, BOLTS - 1, 1)
    assert (scores.sure_false, scores.sure_misplaced) == (1, 1)
    assert scores.worst_sure_mm == pytest.approx(0.8)
    stated = {bolt.found_id: (bolt.confidence, bolt.is_right) for bolt in record.motors[0].stated}
    assert stated["X1"] == (0.9, False)
    assert sorted(right for _, right in stated.values()) == [False, False] + [True] * (BOLTS - 2)
    text = render_priors([record])
    assert "X1 is none (sure)" in text
    assert "missed bolt" in text
    assert "sure and 0.80 mm beside" in text
    assert priors_summary(record).row_count == 11


def test_confidence_is_held_against_what_the_bolts_are(data: Path, one_folder: Path) -> None:
    def state(bolts: tuple[PriorBolt, ...]) -> tuple[PriorBolt, ...]:
        return tuple(replace(bolt, confidence=0.5) for bolt in bolts)

    record = evaluate_priors(data, one_folder, pipeline=pipeline_of(data, state))
    reliability = confidence_reliability(record)
    assert reliability is not None
    # all are right, half was said
    assert reliability.expected_error == pytest.approx(0.5)
    assert reliability.brier == pytest.approx(0.25)


def test_a_motor_without_a_prior_misses_all_its_bolts(data: Path, one_folder: Path) -> None:
    def fail(*_: object) -> Prior:
        raise EmptyScanError("no housing")

    broken = replace(tiny_pipeline(data), build_prior=fail)
    record = evaluate_priors(data, one_folder, motors=["motor_000"], pipeline=broken)
    scores = score_priors(record)
    assert (scores.found, scores.without_prior, scores.recall) == (0, 1, 0.0)
    assert confidence_reliability(record) is None
    assert "no housing" in render_priors([record])


def test_what_is_not_there_is_told(data: Path, leave_out: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="motor_999"):
        evaluate_priors(data, leave_out, motors=["motor_999"], pipeline=tiny_pipeline(data))
    (leave_out / "leave_family_out" / "odd").rmdir()
    with pytest.raises(InputFileError, match="not seen this family"):
        evaluate_priors(data, leave_out, pipeline=tiny_pipeline(data))
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(InputFileError, match="priors-only"):
        read_priors(tmp_path / "other.json")


def test_no_record_gives_no_section() -> None:
    assert render_priors([]) == ""
