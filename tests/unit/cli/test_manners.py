from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from boltpose.cli.app import app, main
from boltpose.cli.console import (
    LiveProgress,
    StageProgress,
    answer_console,
    answer_json,
    note_console,
    warn,
)
from boltpose.cli.examples import EXAMPLES
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.manners import add_manners, leaf_commands
from boltpose.prior.file import read_prior
from tests.support import results
from tests.unit.cli.conftest import Cell, Run

ROOT = typer.main.get_command(app)
add_manners(ROOT)
COMMANDS = leaf_commands(ROOT)
LINES = [(path, line) for path, lines in EXAMPLES.items() for line in lines]


@pytest.mark.parametrize("path", COMMANDS)
def test_a_command_says_in_one_sentence_what_it_is_for_and_shows_examples(path: str) -> None:
    first = COMMANDS[path].help.strip().split("\n\n")[0]

    assert first.endswith(".")
    assert ". " not in first
    assert 1 <= len(EXAMPLES[path]) <= 3
    assert all(line in COMMANDS[path].epilog for line in EXAMPLES[path])


def test_no_example_is_of_a_command_that_is_not_there() -> None:
    assert set(EXAMPLES) == set(COMMANDS)


@pytest.mark.parametrize(("path", "line"), LINES, ids=[line for _, line in LINES])
def test_an_example_is_a_command_line_of_its_command(path: str, line: str) -> None:
    words = shlex.split(line)
    depth = 1 + len(path.split())

    assert words[:depth] == ["boltpose", *path.split()]
    # raises if an option is unknown, a value out of its choice or something required is missing
    COMMANDS[path].make_context(path, words[depth:])


@pytest.mark.parametrize("path", COMMANDS)
def test_every_command_can_be_quiet_and_answer_in_json(path: str) -> None:
    options = [name for param in COMMANDS[path].params for name in param.opts]

    assert options.count("--json") == options.count("--quiet") == options.count("-q") == 1


@pytest.mark.parametrize("path", COMMANDS)
def test_with_json_an_error_is_one_document_on_stdout_and_one_line_on_stderr(
    run: Run, path: str
) -> None:
    outcome = run(*path.split(), "--json", "--no-such-option")

    assert outcome.code == ExitCode.BAD_INPUT
    error = json.loads(outcome.out)["error"]
    assert error["exit_code"] == ExitCode.BAD_INPUT
    assert outcome.err == f"boltpose: {error['message']}\n"
    assert "--no-such-option" in error["message"]


def test_an_error_after_the_answer_adds_no_second_document(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(*_: object, **__: object) -> None:
        answer_json({"url": "there"})  # as view does, long before it ends
        os.kill(os.getpid(), signal.SIGTERM)
        signal.pause()

    monkeypatch.setattr("boltpose.io.scan.read_raw_scan", read)

    outcome = run("label", cell.scan, "--json")

    assert outcome.code == ExitCode.TERMINATED
    assert json.loads(outcome.out) == {"url": "there"}
    assert outcome.err == "boltpose: terminated\n"


def test_without_json_an_error_leaves_stdout_empty(run: Run, tmp_path: Path) -> None:
    outcome = run("prior", "show", tmp_path / "none.prior.npz")

    assert (outcome.code, outcome.out) == (ExitCode.BAD_INPUT, "")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize(
    ("line", "meant"),
    [("lcate", "locate"), ("config chek", "check"), ("locate s.ply --pror x", "--prior")],
)
def test_a_slip_of_the_keyboard_gets_a_suggestion(run: Run, line: str, meant: str) -> None:
    outcome = run(*line.split())

    assert outcome.code == ExitCode.BAD_INPUT
    assert meant in outcome.err
    assert outcome.err.count("\n") == 1


def test_json_of_commands_that_write_files_names_them(run: Run, cell: Cell) -> None:
    spec, settings = cell.folder / "motor.json", cell.folder / "cell.toml"

    assert json.loads(run("config", "init", "-o", settings, "--json").out) == {
        "file": str(settings)
    }
    assert json.loads(run("synth", "spec", "-o", spec, "--json").out) == {"files": [str(spec)]}
    assert settings.is_file()
    assert spec.is_file()


def test_json_of_locate_is_the_poses_file(run: Run, cell: Cell, answer) -> None:
    answer(lambda scan, prior, base: results.located(prior, base))
    poses = cell.folder / "poses.json"

    outcome = run("locate", cell.scan, "--prior", cell.prior, "--json", "-o", poses)

    assert json.loads(outcome.out) == json.loads(poses.read_text())


def test_quiet_leaves_the_answer_and_the_warnings(run: Run, cell: Cell, answer) -> None:
    answer(lambda scan, prior, base: results.located(prior, base))
    line = ("locate", cell.scan, "--prior", cell.prior)

    loud, quiet = run(*line), run(*line, "--quiet")

    assert quiet.out == loud.out
    assert "segmentation" in loud.err
    assert "segmentation" not in quiet.err
    assert "NOT in the robot's base" in quiet.err


def test_quiet_leaves_errors(run: Run, tmp_path: Path) -> None:
    outcome = run("prior", "show", tmp_path / "none.prior.npz", "-q")

    assert outcome.code == ExitCode.BAD_INPUT
    assert "no such file" in outcome.err


def test_quiet_ends_with_its_command_line(run: Run, cell: Cell) -> None:
    run("prior", "show", cell.prior, "--quiet")
    target = cell.folder / "copy.prior.npz"
    bolt = cell.known.bolts[0].id

    outcome = run("prior", "edit", cell.prior, "--name", f"{bolt}=front", "-o", target)

    assert f"wrote {target}" in outcome.err
    assert read_prior(target).bolts[0].name == "front"


def test_help_states_the_exit_codes(run: Run) -> None:
    outcome = run("--help")
    text = " ".join(outcome.out.split())

    assert all(f"{int(code)} " in text for code in ExitCode)


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_no_colour_where_none_is_wanted(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str]
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("FORCE_COLOR", "1")  # else there is no colour here anyway
    assert answer_console().color_system is not None
    monkeypatch.delenv("FORCE_COLOR")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)

    for console in (answer_console(), note_console()):
        assert console.no_color or console.color_system is None


COLOUR = re.compile(r"\x1b\[[0-9;]*?(?:3[0-8]|4[0-8]|9[0-7]|10[0-7])[0-9;]*m")
"""Parameters of SGR that are colours; 1 is bold, 2 dim."""


@pytest.mark.parametrize("line", [("prior", "show"), ("locate", "--help")])
def test_with_no_color_a_terminal_gets_bold_but_no_colour(
    run: Run, cell: Cell, monkeypatch: pytest.MonkeyPatch, line: tuple[str, ...]
) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("FORCE_COLOR", "1")  # as on a terminal
    monkeypatch.delenv("NO_COLOR", raising=False)
    words = (*line, cell.prior) if line[0] == "prior" else line
    assert COLOUR.search(run(*words).out)
    monkeypatch.setenv("NO_COLOR", "1")

    bare = run(*words).out

    assert not COLOUR.search(bare)
    assert "\x1b[1m" in bare


def test_a_warning_keeps_its_brackets(capsys: pytest.CaptureFixture[str]) -> None:
    warn("key [robot] is odd")

    assert capsys.readouterr().err == "warning: key [robot] is odd\n"


def test_progress_is_not_drawn_into_a_log(capsys: pytest.CaptureFixture[str]) -> None:
    progress: LiveProgress = StageProgress("locating")
    with progress:
        pass

    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_call_boltpose(shell: str) -> None:
    done = _complete({"_BOLTPOSE_COMPLETE": f"source_{shell}"})

    assert done.returncode == 0
    assert "_BOLTPOSE_COMPLETE=complete_" + shell in done.stdout
    assert done.stderr == ""


def test_completion_knows_commands_and_options() -> None:
    bash = {"_BOLTPOSE_COMPLETE": "complete_bash"}

    commands = _complete(bash | {"COMP_WORDS": "boltpose prior ", "COMP_CWORD": "2"})
    options = _complete(bash | {"COMP_WORDS": "boltpose locate --hand", "COMP_CWORD": "2"})

    assert set(commands.stdout.split()) == {"build", "show", "edit", "review"}
    assert set(options.stdout.split()) == {
        "--hand-eye",
        "--hand-eye-unit",
        "--hand-eye-sigma",
    }


class Tab:
    """The Tab key at the end of a line: what boltpose says to the script of a shell."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.monkeypatch, self.capsys = monkeypatch, capsys

    def ask(self, shell: str, line: str, fish: str = "get-args") -> tuple[str, int]:
        words = str(len(line.split(" ")) - 1)
        said = {"COMP_WORDS": line, "COMP_CWORD": words, "_TYPER_COMPLETE_ARGS": line}
        said |= {"_BOLTPOSE_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_FISH_ACTION": fish}
        with self.monkeypatch.context() as patch:
            for name, value in said.items():
                patch.setenv(name, value)
            with pytest.raises(SystemExit) as end:
                ROOT.main(args=[], prog_name="boltpose", standalone_mode=False)  # pyright: ignore
        return self.capsys.readouterr().out, int(end.value.code or 0)

    def words(self, shell: str, line: str) -> list[str]:
        out = self.ask(shell, line)[0]
        if shell == "zsh":  # "word":"help" or "word"
            return re.findall(r'"([^"]+)"(?::"[^"]*")?', out)
        return [row.split("\t")[0] for row in out.split("\n") if row.strip()]


@pytest.fixture
def tab(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Tab:
    return Tab(monkeypatch, capsys)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_tab_key_completes_commands_and_choices(tab: Tab, shell: str) -> None:
    assert tab.words(shell, "boltpose lo") == ["locate"]
    targets = tab.words(shell, "boltpose export-poses poses.json --to ")
    assert targets == ["urscript", "kuka", "fanuc", "abb", "ros2-mcap", "bop-csv", "csv"]
    assert tab.words(shell, "boltpose export-poses poses.json --to k") == ["kuka"]


@pytest.mark.parametrize("line", ["boltpose locate sc", "boltpose locate scan.ply --prior mo"])
def test_the_tab_key_leaves_files_to_the_shell(tab: Tab, line: str) -> None:
    # bash takes files where boltpose has no words: `-o default` in its script
    assert tab.words("bash", line) == []
    assert tab.ask("zsh", line)[0].strip() == "_files"
    # fish asks first whether boltpose has words, and takes files if not
    assert tab.ask("fish", line, "is-args")[1] != 0
    assert tab.ask("fish", "boltpose lo", "is-args")[1] == 0


def test_in_bash_the_tab_key_does_it() -> None:
    script = _complete({"_BOLTPOSE_COMPLETE": "source_bash"}).stdout
    command = f"{shlex.quote(sys.executable)} -m boltpose"
    assert "complete -o default -F _boltpose_completion boltpose" in script
    script = script.replace("complete_bash $1", f"complete_bash {command}")
    tab = 'COMP_WORDS=(boltpose lo); COMP_CWORD=1; _boltpose_completion x; echo "${COMPREPLY[@]}"'

    done = subprocess.run(
        ["bash", "--norc", "-c", f"{script}\n{tab}"], capture_output=True, text=True, check=False
    )

    assert (done.stdout, done.stderr) == ("locate\n", "")


def test_bash_takes_the_completion_script() -> None:
    script = _complete({"_BOLTPOSE_COMPLETE": "source_bash"}).stdout

    done = subprocess.run(["bash", "-n"], input=script, capture_output=True, text=True, check=False)

    assert (done.returncode, done.stderr) == (0, "")


def _complete(environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    code = "import sys; from boltpose.cli.app import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )


def test_sigterm_unwinds_and_has_its_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], cell: Cell
) -> None:
    unwound: list[bool] = []

    def read(path: Path) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            signal.pause()
        finally:
            unwound.append(True)

    monkeypatch.setattr("boltpose.prior.file.read_prior", read)

    code = main(["prior", "show", str(cell.prior)])

    assert (code, unwound) == (ExitCode.TERMINATED, [True])
    assert capsys.readouterr().err == "boltpose: terminated\n"
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
