"""What docs/train-your-own.md tells people to type exists, and its tables are true."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import typer

from boltpose.cli.app import app
from boltpose.io.label_files import PCD_LABEL, PLY_LABEL
from boltpose.io.palette import PALETTE
from boltpose.schema import Part

TEXT = (Path(__file__).resolve().parents[3] / "docs" / "train-your-own.md").read_text("utf-8")


def _commands() -> list[str]:
    """Indented and fenced command lines, and commands in running text."""
    lines = re.findall(r"^(?:    |\$ )(boltpose .+?)$", TEXT, re.MULTILINE)
    inline = [" ".join(code.split()) for code in re.findall(r"`(boltpose [^`]+)`", TEXT)]
    return list(dict.fromkeys(lines + [code for code in inline if len(code.split()) > 3]))


COMMANDS = _commands()


def test_the_page_goes_the_whole_way() -> None:
    steps = ("synth motors", "label", "label --to-colours", "label --from-colours", "train parts")
    for step in (*steps, "export", "prior build"):
        assert any(command.startswith(f"boltpose {step} ") for command in COMMANDS), step
    train = next(command for command in COMMANDS if "--data mine" in command)
    for option in ("--pretrained", "--warm-up 5", "--out", "--leave-out"):
        assert option in train


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_exists_with_its_options(line: str) -> None:
    words = shlex.split(line)[1:]
    command = typer.main.get_command(app)
    name = "boltpose"
    while hasattr(command, "commands"):
        name = words.pop(0)
        command = command.commands[name]
    # parses and converts every argument as a real call does, and stops before running it
    context = command.make_context(name, words)
    assert context.params


def test_tables_of_labels_and_colours_are_those_of_the_code() -> None:
    rows = re.findall(r"^\| (\d) \| ([a-z ]+) \| (\d+) (\d+) (\d+) \|$", TEXT, re.MULTILINE)
    listed = {Part(int(row[0])): tuple(map(int, row[2:])) for row in rows}
    assert listed == PALETTE
    assert [row[1].replace(" ", "_") for row in rows] == [part.name.lower() for part in Part]
    assert f"`{PLY_LABEL}`" in TEXT
    assert f"`{PCD_LABEL}`" in TEXT


def test_no_output_is_missing() -> None:
    assert "<!--" not in TEXT
