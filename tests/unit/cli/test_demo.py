"""The demo, as `make demo` runs it, against the truth of the data set it comes from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from boltpose.cli.demo import DEMO_FOLDER
from boltpose.prior.file import read_prior
from tests.support.tree import ROOT
from tests.unit.cli.conftest import Run

MOTOR, VIEW = ROOT / "data" / "reman18" / "motor_001", "2"


def test_the_demo_finds_every_bolt_hidden_or_not(run: Run, tmp_path: Path) -> None:
    outcome = run("demo", "-o", tmp_path / "out")

    assert outcome.code == 0, outcome.err
    poses = json.loads((tmp_path / "out" / "poses.json").read_text())
    truth = json.loads((MOTOR / "bolts.json").read_text())[VIEW]["bolts"]
    assert poses["frame"] == "base"
    assert len(poses["bolts"]) == len(truth) == 9
    tops = np.array([bolt["head_top"] for bolt in poses["bolts"]])
    axes = np.array([bolt["axis"] for bolt in poses["bolts"]])
    for bolt in truth:
        head_top, axis = np.array(bolt["A"]["head_top"]), np.array(bolt["A"]["axis"])
        offset = tops - head_top
        nearest = int(np.argmin(np.linalg.norm(offset, axis=1)))
        along = offset[nearest] @ axis
        assert np.linalg.norm(offset[nearest] - along * axis) < 1.0
        assert abs(along) < 1.0
        assert axes[nearest] @ axis > np.cos(np.radians(1.0))
        assert poses["bolts"][nearest]["side"] == bolt["side"]
        is_hidden = poses["bolts"][nearest]["visibility"] == "hidden"
        assert is_hidden == (bolt["visible_fraction"] < 0.1)
    assert sum(bolt["visibility"] == "hidden" for bolt in poses["bolts"]) == 5
    assert len(read_prior(tmp_path / "out" / "motor.prior.npz").bolts) == 9
    for name in ("demo.png", "prior.png"):
        assert (tmp_path / "out" / name).stat().st_size > 50_000
    # the table is on stdout, everything else is not
    assert outcome.out.count("OK: 9 bolts in frame 'base'") == 1
    assert "boltpose locate" in outcome.err

    # once more from the prior on disk: the same, but for the time it took
    again = tmp_path / "again.json"
    outcome = run(
        "locate", DEMO_FOLDER / "000002.png", "--prior", tmp_path / "out" / "motor.prior.npz",
        "--hand-eye", DEMO_FOLDER / "hand_eye.yaml",
        "--camera", DEMO_FOLDER / "scene_camera.json", "-o", again, "--picture", tmp_path / "p.png",
    )  # fmt: skip
    assert outcome.code == 0
    repeated = json.loads(again.read_text())
    assert repeated.pop("timings_ms").keys() == poses.pop("timings_ms").keys()
    assert repeated == poses
