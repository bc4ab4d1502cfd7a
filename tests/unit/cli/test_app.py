from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import boltpose
from boltpose.cli import app
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.options import LengthUnit
from boltpose.io.units import Unit
from tests.unit.cli.conftest import Cell, Run


def test_help_imports_nothing_heavy() -> None:
    # in a process of its own: this one has everything imported
    code = (
        "import sys\n"
        "from boltpose.cli.app import main\n"
        "assert main(['locate', '--help']) == 0\n"
        "heavy = {'numpy', 'scipy', 'onnxruntime', 'matplotlib', 'torch', 'h5py'}\n"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)\n"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert (done.returncode, done.stderr) == (0, "")
    assert "--hand-eye" in done.stdout


def test_no_arguments_show_the_commands(run: Run) -> None:
    outcome = run()

    assert outcome.code == 0
    assert all(name in outcome.out for name in ("prior", "locate", "demo", "evaluate", "train"))
    assert "3 pose refused" in outcome.out


@pytest.mark.parametrize("group", ["prior", "train"])
def test_a_group_alone_shows_its_commands(run: Run, group: str) -> None:
    outcome = run(group)

    assert outcome.code == 0
    assert "Commands" in outcome.out


def test_version(run: Run) -> None:
    outcome = run("--version")

    assert (outcome.code, outcome.out, outcome.err) == (0, f"{boltpose.__version__}\n", "")


@pytest.mark.parametrize(
    "arguments",
    [
        ("bolts",),
        ("locate",),
        ("locate", "scan.ply"),
        ("locate", "scan.ply", "--prior", "p.npz", "--unit", "mm"),
        ("locate", "scan.ply", "--prior", "p.npz", "--scan-unit", "furlong"),
        ("prior", "bild", "x"),
        ("prior", "edit", "p.npz", "--add"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_exit_2(run: Run, arguments: tuple[str, ...]) -> None:
    outcome = run(*arguments)

    assert outcome.code == ExitCode.BAD_INPUT
    assert outcome.out == ""
    assert outcome.err.startswith("boltpose: ")
    assert outcome.err.count("\n") == 1


def test_ctrl_c_is_exit_130(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_arguments: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("boltpose.prior.file.read_prior", interrupted)

    outcome = run("prior", "show", "p.npz")

    assert outcome.code == ExitCode.INTERRUPTED
    assert "Traceback" not in outcome.err
    assert (outcome.out, outcome.err) == ("", "boltpose: interrupted\n")
    document = json.loads(run("prior", "show", "p.npz", "--json").out)
    assert document == {"error": {"message": "interrupted", "exit_code": 130}}


def test_our_own_mistakes_keep_their_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_path: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("boltpose.prior.file.read_prior", broken)

    with pytest.raises(ZeroDivisionError):
        app.main(["prior", "show", "p.npz"])


def test_a_reader_that_has_gone_gives_no_traceback(cell: Cell) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    done = subprocess.run(
        [sys.executable, "-m", "boltpose", "prior", "show", str(cell.prior), "--json"],
        stdout=write_end,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(write_end)

    assert "Traceback" not in done.stderr
    assert done.returncode == ExitCode.BAD_INPUT


def test_length_units_are_those_of_io() -> None:
    assert {unit.value for unit in LengthUnit} == {unit.value for unit in Unit}


def test_every_command_has_a_first_line_of_help() -> None:
    command = typer.main.get_command(app.app)
    groups = [command]
    while groups:
        group = groups.pop()
        for child in group.commands.values():  # pyright: ignore
            assert child.help, child.name
            groups += [child] if hasattr(child, "commands") else []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize(
    ("words", "code"), [("--version", ExitCode.BAD_INPUT), ("x --json", ExitCode.BAD_INPUT)]
)
def test_a_disk_that_is_full_ends_with_the_documented_code(words: str, code: ExitCode) -> None:
    call = f"{shlex.quote(sys.executable)} -m boltpose {words} >/dev/full"
    done = subprocess.run(["sh", "-c", call], capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_a_stream_that_is_closed_changes_no_code(closed: str) -> None:
    for words, code in (("--version", ExitCode.OK), ("nonsense", ExitCode.BAD_INPUT)):
        call = f"{shlex.quote(sys.executable)} -m boltpose {words} {closed}"
        done = subprocess.run(["sh", "-c", call], capture_output=True, text=True, check=False)
        assert done.returncode == code
        assert "Traceback" not in done.stderr
