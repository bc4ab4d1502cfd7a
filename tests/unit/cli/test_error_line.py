"""What is said of a slip: what was likely meant, and never what would be dangerous."""

from __future__ import annotations

import os
import pty
import shutil
import subprocess
import sys
import termios
from pathlib import Path
from typing import Any

import pytest
import typer

from boltpose.cli.app import app
from boltpose.cli.error_line import error_line
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.manners import leaf_commands
from boltpose.errors import InputFileError
from tests.unit.cli.conftest import Cell, Run

COMMANDS = leaf_commands(typer.main.get_command(app))


def choices() -> list[Any]:
    """Every option and argument of every command that is one of some words."""
    found = []
    for path, command in COMMANDS.items():
        for param in command.params:
            annotation = getattr(param, "type_descriptor", None)
            if annotation is not None and annotation.is_choice:
                words = [str(choice) for choice in annotation.choices]
                found.append(pytest.param(path, param, words, id=f"{path} {param.opts[0]}"))
    return found


def test_there_are_choices() -> None:
    assert {"export-poses --to", "locate --scan-unit", "reproduce table"} <= {
        str(entry.id) for entry in choices()
    }


@pytest.mark.parametrize(("path", "param", "words"), choices())
def test_a_mistyped_choice_gets_a_suggestion(
    run: Run, path: str, param: Any, words: list[str]
) -> None:
    meant = max(words, key=len)
    slip = meant[1] + meant[0] + meant[2:]  # two neighbours the wrong way round
    name = param.opts[0]
    given = [name, slip] if name.startswith("--") else [slip]

    outcome = run(*path.split(), *given)

    assert outcome.code == ExitCode.BAD_INPUT
    assert f"found '{slip}' (did you mean '{meant}'?), wanted {', '.join(words)}" in outcome.err
    assert outcome.err.endswith(f"; see `boltpose {path} --help`\n")
    assert outcome.err.count("\n") == 1


def test_what_is_near_nothing_gets_none(run: Run) -> None:
    outcome = run("export-poses", "--to", "zzzzzz")

    assert "found 'zzzzzz', wanted urscript" in outcome.err


@pytest.mark.parametrize(
    "line",
    [
        ("locate", "SCAN", "--prior", "PRIOR"),
        ("locate", "scan.ply", "--prior", "PRIOR"),
        ("locate", "scan.ply", "--prior", "cube.prior.npz", "--hand-eye", "HAND_EYE"),
        ("locate", "scan.ply", "--prior", "cube.prior.npz", "--config", "HAND_EYE"),
        ("prior", "build", "SCAN", "-o", "new.prior.npz"),
        ("prior", "show", "PRIOR"),
        ("prior", "edit", "PRIOR", "--remove", "T1"),
        ("view", "PRIOR"),
        ("report", "HAND_EYE"),
        ("export-poses", "HAND_EYE", "--to", "csv", "-o", "bolts.csv"),
        ("label", "SCAN"),
        ("config", "check", "HAND_EYE"),
        ("synth", "model", "HAND_EYE", "-o", "model"),
        ("train", "parts", "--data", "FOLDER", "--out", "run"),
        ("synth", "card", "FOLDER"),
        ("locate", "FOLDER/scan.ply", "--prior", "cube.prior.npz"),
    ],
    ids=" ".join,
)
def test_a_mistyped_file_gets_a_suggestion(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch, line: tuple[str, ...]
) -> None:
    monkeypatch.chdir(cell.folder)
    (cell.folder / "motors").mkdir()
    shutil.copy(cell.scan, cell.folder / "motors")
    slips = {
        "SCAN": ("scan.lpy", "scan.ply"),
        "PRIOR": ("cube.pror.npz", "cube.prior.npz"),
        "HAND_EYE": ("hand_eye.yml", "hand_eye.yaml"),
        "FOLDER": ("mtoors", "motors"),
        "FOLDER/scan.ply": ("mtoors/scan.ply", "motors"),
    }
    slip, meant = next(slips[word] for word in line if word in slips)

    outcome = run(*(slips.get(word, (word,))[0] for word in line))

    assert outcome.code == ExitCode.BAD_INPUT
    assert outcome.err.startswith(f"boltpose: {slip}: found no ")
    assert f"(did you mean '{meant}'?), wanted " in outcome.err
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize(
    ("there", "asked"),
    [
        ("scan_0040.zdf", "scan_0041.zdf"),  # another clamping, not a slip
        ("motor_1.prior.npz", "motor_2.prior.npz"),
        ("motors", "poses.json"),
        ("scan.zdf", "scan.zdf/below.zdf"),
        ("scan.zdf", "x" * 300),
    ],
)
def test_another_file_is_not_suggested(tmp_path: Path, there: str, asked: str) -> None:
    (tmp_path / there).touch()

    line = error_line(InputFileError(tmp_path / asked, "no such file", "a scan"))

    assert line == f"{tmp_path / asked}: found no such file, wanted a scan"


def test_a_file_that_is_there_gets_no_suggestion(tmp_path: Path) -> None:
    for name in ("a.toml", "b.toml"):
        (tmp_path / name).touch()

    line = error_line(InputFileError(tmp_path / "a.toml", "no TOML", "settings"))

    assert "did you mean" not in line


def test_an_output_with_a_wrong_ending_gets_no_input_for_a_name(run: Run, cell: Cell) -> None:
    outcome = run("prior", "edit", cell.prior, "--remove", "T1", "-o", cell.folder / "scan.py")

    assert "did you mean" not in outcome.err


@pytest.mark.parametrize(
    "words", [("--prior", ""), ("--prior=",), ("--hand-eye", ""), ("--by", "")]
)
def test_a_variable_that_is_not_set_is_no_folder(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    # pathlib takes the empty word for `.`, and a folder of priors is a fine --prior
    monkeypatch.chdir(cell.folder)

    outcome = run("locate", cell.scan, *words)

    assert outcome.code == ExitCode.BAD_INPUT
    assert "is a variable of the script not set?" in outcome.err


def test_a_value_is_named_that_is_no_number(run: Run) -> None:
    assert run("serve", "--port", "abc").err == (
        "boltpose: Invalid value for '--port': Input should be a valid integer, found 'abc'; "
        "see `boltpose serve --help`\n"
    )


def test_a_line_is_never_broken_and_never_coloured(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = cell.folder / ("a long [red]folder name " * 8).strip() / os.fsdecode(b"scan\xff.ply")
    for name, value in (("COLUMNS", "40"), ("FORCE_COLOR", "1"), ("TERM", "xterm-256color")):
        monkeypatch.setenv(name, value)

    outcome = run("locate", deep, "--prior", cell.prior)

    name = str(deep).encode("utf-8", "backslashreplace").decode()
    assert outcome.err.startswith(f"boltpose: {name}: found no such file, wanted a scan")
    assert outcome.err.count("\n") == 1
    assert "\x1b" not in outcome.err


def test_a_terminal_and_a_pipe_get_the_same_bytes(tmp_path: Path) -> None:
    deep = str(tmp_path / ("a long folder name " * 8).strip() / "scan.ply")
    command = [sys.executable, "-m", "boltpose", "locate", deep, "--prior", "p.prior.npz"]
    environment = os.environ | {"TERM": "xterm-256color"}
    piped = subprocess.run(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, check=False, env=environment
    ).stderr
    ours, theirs = pty.openpty()
    with os.fdopen(ours, "rb", buffering=0) as terminal:
        termios.tcsetwinsize(theirs, (24, 60))  # narrower than the path
        subprocess.run(command, stderr=theirs, stdout=theirs, check=False, env=environment)
        os.close(theirs)
        shown = terminal.read(65536)

    assert piped.count(b"\n") == 1
    assert deep.encode() in piped
    assert shown.replace(b"\r\n", b"\n") == piped
