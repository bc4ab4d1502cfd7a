from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.datasets.reman18 import Reman18
from boltpose.io.labelled import write_ply
from boltpose.segmentation.predictor import PartProbabilities
from boltpose.training.__main__ import main
from boltpose.training.local_evidence import cross_fitting_folds
from boltpose.training.parts import PartsConfig
from boltpose.training.runs import (
    EvidenceRun,
    score_parts,
    score_scene,
    train_part_models,
    write_metrics,
)
from boltpose.training.scores import SegmentationScores
from boltpose.training.shipping import ALL_MOTORS, ship_models
from tests.support.toy_motor import toy_motor

DATA = Reman18(root=Path(__file__).parents[3] / "data" / "reman18")


class _Truth:
    """Knows the labels of one motor; says housing for every tenth point."""

    def __init__(self, labels: np.ndarray) -> None:
        self.labels = labels

    def predict(self, points: np.ndarray, normals: np.ndarray) -> PartProbabilities:
        guess = np.where(np.arange(len(points)) % 10 == 0, 1, self.labels)
        return PartProbabilities(probabilities=np.eye(6, dtype=np.float32)[guess - 1])


def test_part_scores_count_every_point() -> None:
    labels = DATA.full_scan("motor_011").labels
    scores = score_parts(_Truth(labels), DATA, ("motor_011",))
    wrong = (labels != 1) & (np.arange(len(labels)) % 10 == 0)
    assert scores.points == len(labels)
    assert scores.overall_accuracy == pytest.approx(1 - wrong.mean())
    assert scores.iou["bolt"] == pytest.approx(0.9, abs=0.01)


def test_scene_scores_count_every_view() -> None:
    class Nothing:
        def predict(self, points: np.ndarray) -> np.ndarray:
            return np.zeros(len(points), dtype=np.float32)

    scores = score_scene(Nothing(), DATA, ("motor_011",))
    motor = sum((DATA.view("motor_011", number).labels > 0).sum() for number in range(4))
    assert scores.iou["motor"] == 0.0
    assert scores.overall_accuracy == pytest.approx(1 - motor / scores.points)


def test_metrics_of_one_network_leave_the_others_alone(tmp_path: Path) -> None:
    good = SegmentationScores(overall_accuracy=0.9, mean_iou=0.8, iou={"a": 0.8}, points=10)
    write_metrics(tmp_path, "parts", good, {"steps": 3})
    write_metrics(tmp_path, "scene", good, {"steps": 4})
    write_metrics(tmp_path, "scene", good, {"steps": 5})
    written = json.loads((tmp_path / "metrics.json").read_text())
    assert written["parts"]["recipe"] == {"steps": 3}
    assert written["scene"]["recipe"] == {"steps": 5}
    assert written["scene"]["held_out"]["overall_accuracy"] == 0.9
    # scored again: the recipe stays
    write_metrics(tmp_path, "scene", good)
    assert json.loads((tmp_path / "metrics.json").read_text()) == written


def test_a_run_that_is_not_finished_is_not_shipped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    family = tmp_path / "parts" / "direct_closed_2ear"
    family.mkdir(parents=True)
    (family / "parts_local.onnx").write_bytes(b"")
    places = ["--parts", str(family.parent), "--out", str(tmp_path / "out")]
    assert main(["ship", "--data", str(DATA.root), *places]) == 2
    assert f"{family}: found no parts.onnx, wanted a finished run folder" in (
        capsys.readouterr().err
    )
    assert not (tmp_path / "out").exists()
    assert main(["cards", "--data", str(tmp_path)]) == 2
    assert "a reman18 folder" in capsys.readouterr().err


def test_finished_runs_are_shipped_with_their_metrics(tmp_path: Path) -> None:
    good = SegmentationScores(overall_accuracy=0.9, mean_iou=0.8, iou={"a": 0.8}, points=10)
    for task in ("parts", "scene"):
        for name in ("a", "b", ALL_MOTORS):
            run = tmp_path / task / name
            run.mkdir(parents=True)
            for file in (f"{task}_local.onnx", f"{task}.onnx", "config.json"):
                (run / file).write_text(f"{task} {name} {file}")
            write_metrics(run, task, good, {"name": name})
    runs = {task: tmp_path / task for task in ("parts", "scene")}
    filled = list(ship_models(runs, tmp_path / "left_out", tmp_path / "shipped", ("a", "b")))
    assert len(filled) == 3
    assert (tmp_path / "shipped" / "scene.onnx").read_text() == "scene shipped scene.onnx"
    assert (tmp_path / "left_out" / "b" / "parts.onnx").read_text() == "parts b parts.onnx"
    metrics = json.loads((tmp_path / "left_out" / "b" / "metrics.json").read_text())
    assert {task: metrics[task]["recipe"]["name"] for task in metrics} == {
        "parts": "b",
        "scene": "b",
    }


def _toys(root: Path, seeds: range, family: str) -> Reman18:
    """Toy motors on disk, in the layout of reman18."""
    for seed in seeds:
        toy = toy_motor(seed=seed, density=0.3)
        folder = root / f"motor_{family}_{seed}"
        folder.mkdir(parents=True)
        write_ply(folder / "prior.ply", toy.points.astype(np.float32), labels=toy.labels)
        (folder / "prior_gt.json").write_text(json.dumps({"family_name": family}))
    return Reman18(root=root)


def test_a_network_trained_on_one_data_set_is_scored_on_all_of_another(tmp_path: Path) -> None:
    _toys(tmp_path / "train", range(2), "one")
    data = _toys(tmp_path / "train", range(2, 4), "two")
    test = _toys(tmp_path / "test", range(7, 8), "three")
    recipe = PartsConfig.for_many_motors()
    recipe = replace(
        recipe,
        pool=1024,
        sub_cloud=256,
        local=replace(recipe.local, fit=replace(recipe.local.fit, steps=120)),
        fit=replace(recipe.fit, steps=40, batch=4),
    )

    out = tmp_path / "out"
    run = EvidenceRun(data=data, leave_out=None, cache=tmp_path / "cache", out=out, test=test)
    scores = train_part_models(run, recipe)

    assert scores is not None
    assert scores.points == len(test.full_scan("motor_three_7").labels)
    assert scores.overall_accuracy > 0.8
    written = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert written["parts"]["held_out"] == scores.to_json()


@pytest.mark.parametrize(("count", "folds"), [(6, 6), (14, 3), (2, 3), (1, 1)])
def test_folds_hold_every_family_once(count: int, folds: int) -> None:
    families = [f"family_{number}" for number in range(count)]
    dealt = cross_fitting_folds(reversed(families), folds)
    assert sorted(name for fold in dealt for name in fold) == sorted(families)
    assert len(dealt) == min(count, folds)
    assert max(map(len, dealt)) - min(map(len, dealt)) <= 1
