from __future__ import annotations

from pathlib import Path

from boltpose.cli.exit_codes import ExitCode
from tests.unit.cli.conftest import Run


def test_priors_only_refuses_a_file_that_is_no_json(run: Run, tmp_path: Path) -> None:
    outcome = run("evaluate", "--priors-only", tmp_path / "priors.txt")

    assert outcome.code == ExitCode.BAD_INPUT
    assert ".json" in outcome.err
    assert list(tmp_path.iterdir()) == []


def test_priors_only_names_the_folder_that_holds_no_motor(run: Run, tmp_path: Path) -> None:
    outcome = run(
        "evaluate", "--data", tmp_path, "--models", tmp_path, "--priors-only", tmp_path / "p.json"
    )

    assert outcome.code == ExitCode.BAD_INPUT
    assert "motor_*" in outcome.err
    assert list(tmp_path.iterdir()) == []
