from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from boltpose.datasets.reman18 import Reman18
from boltpose.segmentation.predictor import PartProbabilities
from boltpose.training.__main__ import main
from boltpose.training.runs import score_parts, score_scene, write_metrics
from boltpose.training.scores import SegmentationScores

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


def test_an_unknown_family_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["parts", "--data", str(DATA.root), "--leave-out", "diesel"]
    assert main([*arguments, "--cache", str(tmp_path), "--out", str(tmp_path)]) == 2
    assert "family must be one of" in capsys.readouterr().err
    assert main(["scene", "--data", str(tmp_path)]) == 2
    assert "a reman18 folder" in capsys.readouterr().err
