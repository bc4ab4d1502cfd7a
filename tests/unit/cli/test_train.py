"""`boltpose train` as a user types it; trainings of seconds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from boltpose.cli.app import main
from boltpose.datasets.open import open_data_set
from boltpose.io.labelled import write_ply
from tests.support.toy_motor import toy_motor

REMAN18 = Path(__file__).parents[3] / "data" / "reman18"
QUICK = ["--epochs", "0.25", "--warm-up", "0.05", "--points", "128", "--batch", "2"]


def write_toys(root: Path, *, density: float = 0.12) -> Path:
    """A user's own labelled scans, two kinds of motors, always of the same names."""
    for number, family in enumerate(("left", "right")):
        (root / family).mkdir(parents=True)
        toy = toy_motor(seed=number, density=density)
        write_ply(root / family / f"toy_{number}.ply", toy.points, labels=toy.labels)
    return root


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toys(tmp_path_factory.mktemp("mine") / "toys")


def test_a_plain_network_is_trained_and_scored_on_the_family_left_out(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    arguments = ["train", "parts", "--data", str(mine), "--inputs", "xyz", *QUICK]
    arguments += ["--backbone", "pct-small", "--cache", str(tmp_path / "cache")]
    assert main([*arguments, "--leave-out", "left", "--out", str(run)]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "parts without left: OA " in captured.err
    described = json.loads((run / "config.json").read_text())
    assert described["motors"] == ["toy_1"]
    assert described["warm_up_epochs"] == 0.05
    metrics = json.loads((run / "metrics.json").read_text())
    assert 0 < metrics["parts"]["held_out"]["overall_accuracy"] <= 1
    assert (run / "weights.safetensors").is_file()

    # and the next one starts from it
    fine = ["--pretrained", str(run), "--out", str(tmp_path / "fine")]
    assert main([*arguments, *fine]) == 0
    described = json.loads((tmp_path / "fine" / "config.json").read_text())
    assert described["motors"] == ["toy_0", "toy_1"]
    assert len(described["pretrained"]) == 64


def test_a_test_set_with_motors_of_the_same_names_is_itself(mine: Path, tmp_path: Path) -> None:
    """Features are kept by motor: those of the training set must not be taken for the others."""
    other = write_toys(tmp_path / "toys", density=0.1)
    run = tmp_path / "run"
    arguments = ["train", "parts", "--data", str(mine), "--inputs", "xyz", *QUICK]
    arguments += ["--backbone", "pct-small", "--cache", str(tmp_path / "cache")]
    assert main([*arguments, "--test", str(other), "--out", str(run)]) == 0
    scored = json.loads((run / "metrics.json").read_text())["parts"]["held_out"]["points"]
    counts = {
        root: sum(len(data.full_scan(motor).labels) for motor in data.motors)
        for root in (mine, other)
        for data in [open_data_set(root)]
    }
    assert counts[mine] != counts[other]
    assert scored == counts[other]


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["--inputs", "colours"], "--inputs must be one of evidence, xyz, normals, features"),
        (["--backbone", "dgcnn"], "--backbone dgcnn reads points: choose --inputs"),
        (["--inputs", "xyz", "--backbone", "resnet"], "backbone must be one of"),
        (["--inputs", "xyz", "--epochs", "1", "--warm-up", "2"], "warm_up_epochs must be in"),
        (["--epochs", "1", "--warm-up", "2"], "--warm-up must be at most the run's 1 epochs"),
        (["--leave-out", "boats"], "--leave-out must be each, none or one of direct_closed_2ear"),
        (["--recipe", "secret"], "--recipe must be one of few, fine-tune, many"),
        (["--accelerator", "abacus"], "accelerator must be one of"),
        (["--test", str(REMAN18), "--leave-out", "offset_reduction"], "exclude each other"),
        (["--data", "/nowhere"], "/nowhere: found"),
        (["--pretrained", "/nowhere"], "found no file, wanted weights of a boltpose network"),
    ],
)
def test_bad_settings_end_in_one_line(
    arguments: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    base = ["train", "parts", "--data", str(REMAN18), "--out", str(run)]
    assert main([*base, "--cache", str(tmp_path / "cache"), *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert wanted in captured.err
    assert len(captured.err.splitlines()) == 1
    assert not run.exists()
