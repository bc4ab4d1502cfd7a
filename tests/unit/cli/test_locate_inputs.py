from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.locate_inputs import hash_inputs, parse_sigma, parse_tool
from boltpose.errors import ConfigError
from boltpose.schema import LocateResult
from tests.support import results
from tests.unit.cli.conftest import LOCATE, Cell, Run

Answer = Callable[[Callable[..., LocateResult]], None]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch, answer: Answer) -> dict:
    """What `locate` was called with."""
    answer(lambda scan, prior, base_from_camera: results.located(prior, base_from_camera))
    replaced = LOCATE.locate
    calls: dict = {}

    def locate(scan, prior, base_from_camera, predictor, config, **rest) -> LocateResult:
        calls.update(config=config, **rest)
        return replaced(scan, prior, base_from_camera, predictor, config, **rest)

    monkeypatch.setattr(LOCATE, "locate", locate)
    return calls


def locate(run: Run, cell: Cell, *more: str | Path):
    return run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye, "--json", *more
    )


def test_residuals_of_the_hand_eye_are_its_error_unless_told_otherwise(
    run: Run, cell: Cell, told: dict
) -> None:
    assert locate(run, cell).code == ExitCode.OK
    assert told["hand_eye_error"] is None

    with cell.hand_eye.open("a") as file:
        file.write("per_pose_residuals: [{rotation_deg: 0.1, translation_mm: 0.6}]\n")
    assert locate(run, cell).code == ExitCode.OK
    assert told["hand_eye_error"].translation_sigma_mm == pytest.approx(0.6 / np.sqrt(3))

    assert locate(run, cell, "--hand-eye-sigma", "0.25,0.02").code == ExitCode.OK
    assert told["hand_eye_error"].translation_sigma_mm == 0.25
    assert np.degrees(told["hand_eye_error"].rotation_sigma_rad) == pytest.approx(0.02)


def test_the_tool_reaches_the_settings_and_provenance(run: Run, cell: Cell, told: dict) -> None:
    assert locate(run, cell, "--tool-tolerance", "0.4,1.5,2").code == ExitCode.OK
    tool = told["config"].tool
    assert (tool.lateral_mm, tool.axial_mm) == (0.4, 1.5)
    assert np.degrees(tool.angle_rad) == pytest.approx(2.0)


@pytest.mark.parametrize("text", ["", "1", "1,2,3", "0,1", "-1,1", "a,b", "nan,1", "inf,1"])
def test_a_sigma_is_two_positive_numbers(text: str) -> None:
    with pytest.raises(ConfigError, match="--hand-eye-sigma"):
        parse_sigma(text)


@pytest.mark.parametrize("text", ["", "1,2,3,4", "0", "1,-2", "x"])
def test_a_tolerance_is_one_to_three_positive_numbers(text: str) -> None:
    with pytest.raises(ConfigError, match="--tool-tolerance"):
        parse_tool(text)


def test_nothing_given_is_nothing_known() -> None:
    assert parse_sigma(None) is None
    assert parse_tool(None) is None


@pytest.mark.parametrize(
    ("scans", "hand_eyes", "robot_poses", "text"),
    [
        (2, 1, 0, "2 scans need 2 --hand-eye"),
        (2, 0, 0, "2 scans need 2 --hand-eye"),
        (2, 3, 0, "2 scans need 2 --hand-eye"),
        (1, 2, 0, "one scan needs one --hand-eye"),
        (2, 1, 1, "2 scans need 2 --robot-pose"),
        (1, 0, 1, "--robot-pose needs --hand-eye"),
    ],
)
def test_files_that_do_not_fit_each_other_are_told_apart(
    run: Run, cell: Cell, scans: int, hand_eyes: int, robot_poses: int, text: str
) -> None:
    arguments = [cell.scan] * scans + ["--prior", cell.prior]
    arguments += ["--hand-eye", cell.hand_eye] * hand_eyes
    arguments += ["--robot-pose", cell.hand_eye] * robot_poses
    outcome = run("locate", *arguments, "-o", cell.folder / "poses.json")
    assert outcome.code == ExitCode.BAD_INPUT
    assert text in " ".join(outcome.err.split())
    assert not (cell.folder / "poses.json").exists()


def test_several_scans_need_one_motor(run: Run, cell: Cell, answer: Answer) -> None:
    answer(lambda scan, prior, base_from_camera: results.located(prior, base_from_camera))
    both = ["--hand-eye", cell.hand_eye, "--hand-eye", cell.hand_eye]
    outcome = run("locate", cell.scan, cell.scan, "--prior", cell.folder, *both)
    assert outcome.code == ExitCode.BAD_INPUT
    assert "with several scans name the motor's .prior.npz" in " ".join(outcome.err.split())


def test_a_folder_without_priors_is_refused(run: Run, cell: Cell, answer: Answer) -> None:
    answer(lambda scan, prior, base_from_camera: results.located(prior, base_from_camera))
    empty = cell.folder / "empty"
    empty.mkdir()
    outcome = run("locate", cell.scan, "--prior", empty)
    assert outcome.code == ExitCode.BAD_INPUT
    assert "no *.prior.npz" in " ".join(outcome.err.split())


def test_the_answer_names_every_file(run: Run, cell: Cell, told: dict) -> None:
    locate(run, cell)
    provenance = told["provenance"]
    assert provenance["scan"] == cell.scan.name
    for name in ("scan_sha256", "prior_sha256", "hand_eye_sha256"):
        assert len(provenance[name]) == 64
    json.dumps(provenance)


def test_a_name_that_is_no_utf8_still_gives_a_file_that_can_be_read(cell: Cell) -> None:
    folder = cell.folder / os.fsdecode(b"cell\xff")
    folder.mkdir()
    scan, prior = cell.scan.rename(folder / "scan.ply"), cell.prior.rename(folder / "p.prior.npz")

    found = hash_inputs([scan], prior, [cell.hand_eye], [], scan_unit="mm", camera=scan)

    json.dumps(found, ensure_ascii=False).encode("utf-8")  # raises for half a character
    assert found["inputs"]["scans"] == [str(cell.folder / r"cell\udcff" / "scan.ply")]  # pyright: ignore
