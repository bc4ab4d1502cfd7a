"""docs/cli.md says of every command and every exit code what the code does, and of no others."""

from __future__ import annotations

import inspect
import re
from typing import Any

import typer

from boltpose.cli.app import app
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.manners import leaf_commands
from tests.support.tree import ROOT

TEXT = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
COMMANDS: dict[str, Any] = leaf_commands(typer.main.get_command(app))


def rows(heading: str) -> list[list[str]]:
    """Cells of the table of a section, but its head and the titles between."""
    section = TEXT.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[1:]]
    return [row for row in cells if not row[0].startswith("**")]


def test_every_command_is_in_the_table_once_and_no_other() -> None:
    names = [row[0] for row in rows("All commands")]

    assert len(names) == len(set(names))
    assert set(names) == {f"`{path}`" for path in COMMANDS}


def test_the_table_says_what_help_says() -> None:
    for name, text, _ in rows("All commands"):
        first = COMMANDS[name.strip("`")].help.strip().split("\n\n")[0]
        assert text == " ".join(first.split())


def test_every_exit_code_is_explained_and_no_other() -> None:
    explained = [int(row[0]) for row in rows("Exit codes")]

    assert explained == [int(code) for code in ExitCode]


def test_the_table_names_the_commands_that_refuse() -> None:
    told = {name.strip("`") for name, _, also in rows("All commands") if also}
    assert {also for _, _, also in rows("All commands")} == {"", str(int(ExitCode.REFUSED))}

    assert told == {path for path, command in COMMANDS.items() if refuses(command.callback)}


def test_every_command_of_the_page_is_one() -> None:
    named = set(re.findall(r"boltpose ([a-z][a-z-]*)", TEXT))

    assert {"locate", "config"} <= named <= {path.split()[0] for path in COMMANDS}


def refuses(callback: Any) -> bool:
    """Whether a command can end with `ExitCode.REFUSED`: itself, or because it calls `locate`."""
    module = inspect.getmodule(callback)
    assert module is not None
    return "ExitCode.REFUSED" in inspect.getsource(callback) or (
        "locate_bolts(" in inspect.getsource(module)
    )
