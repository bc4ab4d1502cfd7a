"""The house keeps what its papers promise; nothing here computes."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest
import typer
import yaml

import boltpose
from boltpose.cli.app import app
from tests.support import tree

ROOT = tree.ROOT
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
MODULES = sorted((ROOT / "src" / "boltpose").rglob("*.py"))


def test_the_tree_in_architecture_is_what_is_on_disk() -> None:
    # `make docs` writes it again
    assert tree.read_tree() == tree.render_tree()


def test_every_tracked_name_in_the_root_is_explained() -> None:
    assert tree.tracked_root_names() <= set(tree.HOUSE)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_modules_are_short_and_say_what_they_are(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert ast.get_docstring(ast.parse(text)), "a module starts with one sentence on what it is"
    assert len(text.splitlines()) <= 400, "past 400 lines, split by noun"
    assert path.name != "utils.py"


def test_the_version_stands_in_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" in project["project"]["dynamic"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "boltpose.__version__"}
    assert "version" not in yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    first = re.search(r"^## (\S+)", changelog, re.MULTILINE)
    assert first is not None
    assert first.group(1) == boltpose.__version__


def _commands() -> dict[str, set[str]]:
    """Command line, `boltpose prior build` and so on, to its options."""
    found: dict[str, set[str]] = {}
    waiting = [("boltpose", typer.main.get_command(app))]
    while waiting:
        name, command = waiting.pop()
        found[name] = {text for param in command.params for text in param.opts} | {"--help"}
        for child in getattr(command, "commands", {}).values():
            waiting.append((f"{name} {child.name}", child))
    return found


def _documented_calls() -> list[tuple[str, str]]:
    calls = []
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8").replace("\\\n", " ")
        for call in re.findall(r"(?:^ {4}|`)(boltpose [a-z][^`\n]*)", text, re.MULTILINE):
            calls.append((str(path.relative_to(ROOT)), call))
    return calls


def test_documents_call_only_commands_and_options_that_exist() -> None:
    commands = _commands()
    calls = _documented_calls()
    assert len(calls) >= 8
    for where, call in calls:
        words = call.split()
        name = "boltpose"
        for word in words[1:]:
            if f"{name} {word}" not in commands:
                break
            name = f"{name} {word}"
        assert name != "boltpose" or words[1].startswith("-"), f"{where}: no such command: {call}"
        for option in re.findall(r"(?<!\S)--?[a-z][a-z-]*", call):
            assert option in commands[name], f"{where}: {name} has no {option}: {call}"


def test_documents_call_only_make_targets_that_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):.*## ", makefile, re.MULTILINE))
    for path in DOCUMENTS:
        for target in re.findall(r"`?make ([a-z-]+)", path.read_text(encoding="utf-8")):
            if target in ("check", "test", "demo", "docs", "setup", "evaluate", "bench", "fmt"):
                assert target in targets, f"{path.name}: make {target}"


def test_links_between_documents_lead_somewhere() -> None:
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        for link in re.findall(r"\]\((?!https?://|#)([^)#\s]+)", text):
            assert (path.parent / link).exists(), f"{path.relative_to(ROOT)}: {link}"


def test_readme_holds_the_section_that_results_go_into() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.index("<!-- results:start -->") < readme.index("<!-- results:end -->")


def test_the_licence_is_apache() -> None:
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in text
    assert "Version 2.0, January 2004" in text
    assert "APPENDIX: How to apply the Apache License to your work." in text


def test_ci_calls_the_make_targets_and_can_be_run() -> None:
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & 0o111
    text = script.read_text(encoding="utf-8")
    assert "set -euo pipefail" in text
    assert re.findall(r"^make --no-print-directory (\w+)", text, re.MULTILINE) == ["check", "test"]


def test_the_demo_is_the_simulated_motor_it_says_it_is() -> None:
    import numpy as np

    from boltpose.cli.demo import DEMO_FOLDER
    from boltpose.io.scan import read_scan

    source = ROOT / "data" / "reman18" / "motor_001"
    demo, original = read_scan(DEMO_FOLDER / "full_scan.ply"), read_scan(source / "prior.ply")
    np.testing.assert_array_equal(demo.points, original.points)
    assert demo.labels is None, "the networks must find the parts themselves"
    view = "000002"
    assert (DEMO_FOLDER / f"{view}.png").read_bytes() == (
        source / "depth" / f"{view}.png"
    ).read_bytes()
    assert (DEMO_FOLDER / "hand_eye.yaml").read_bytes() == (
        source / "hand_eye" / f"{view}.yaml"
    ).read_bytes()
