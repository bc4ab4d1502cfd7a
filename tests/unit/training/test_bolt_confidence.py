from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.geometry.transforms import Transform
from boltpose.prior.confidence import ConfidenceConfig
from boltpose.prior.find_bolts import FindBoltsConfig
from boltpose.schema import Prior, Side
from boltpose.segmentation.predictor import PartProbabilities
from boltpose.training.bolt_confidence import (
    WEIGHTS,
    TrueHead,
    candidate_heads,
    fit_weights,
    is_true,
    main,
    read_truth,
)
from tests.support.toy_heads import PLATE_MM, ToyHead, toy_plate, true_alignment

HEADS = (ToyHead(x=0.0, y=15.0), ToyHead(x=-15.0, y=-10.0, side=Side.BOTTOM))


def test_weights_that_made_the_truth_are_found_again() -> None:
    rng = np.random.default_rng(0)
    evidence = np.column_stack([np.ones(20000), rng.normal(size=(20000, 3))])
    weights = np.array([-0.5, 1.5, -1.0, 0.0])
    is_bolt = rng.random(20000) < 1 / (1 + np.exp(-evidence @ weights))
    np.testing.assert_allclose(fit_weights(evidence, is_bolt), weights, atol=0.08)


def test_a_kind_never_seen_true_gets_a_finite_weight() -> None:
    evidence = np.array([[1.0, 0.0]] * 20 + [[1.0, 1.0]] * 5)
    weights = fit_weights(evidence, np.arange(25) < 20)
    assert np.isfinite(weights).all()
    assert weights[1] < -2


def test_the_weights_are_fields_of_the_model() -> None:
    assert set(WEIGHTS) < {entry.name for entry in fields(ConfidenceConfig)}


def test_heads_are_candidates_and_true_only_on_their_own_side() -> None:
    plate = toy_plate(HEADS)
    prior = Prior(
        name="plate",
        points=plate.points,
        normals=plate.normals,
        labels=plate.labels,
        bolts=(),
        alignment=true_alignment(),
    )
    parts = PartProbabilities(probabilities=plate.probabilities().astype(np.float32))
    heads = candidate_heads(prior, parts, FindBoltsConfig())
    z = PLATE_MM / 2 + 4.0
    truth = (TrueHead(side=Side.TOP, head_top_mm=np.array([0.0, 15.0, z])),)
    assert sorted((head.side, is_true(prior, head, truth)) for head in heads) == [
        (Side.BOTTOM, False),
        (Side.TOP, True),
    ]
    wrong = (TrueHead(side=Side.BOTTOM, head_top_mm=np.array([0.0, 15.0, z])),)
    assert not any(is_true(prior, head, wrong) for head in heads)
    assert true_alignment().prior_from_motor.matrix == pytest.approx(
        Transform.identity("prior", "motor").matrix
    )


def test_the_truth_is_read_and_anything_else_refused(tmp_path: Path) -> None:
    path = tmp_path / "prior_gt.json"
    path.write_text(json.dumps({"bolts": [{"side": "top", "C": {"head_top": [1, 2, 3]}}]}))
    (bolt,) = read_truth(path)
    assert bolt.side is Side.TOP
    np.testing.assert_array_equal(bolt.head_top_mm, [1, 2, 3])
    path.write_text(json.dumps({"bolts": [{"side": "left"}]}))
    with pytest.raises(InputFileError, match="prior_gt"):
        read_truth(path)


def test_a_folder_without_motors_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--data", str(tmp_path)]) == 2
    assert "motor_*" in capsys.readouterr().err
