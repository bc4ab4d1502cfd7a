"""`boltpose config init|check|show`: the settings of a cell, before production uses them."""

from __future__ import annotations

import json
import os
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

import typer

from boltpose.cli.cell import ConfigOption
from boltpose.cli.console import answer_console, answer_json, note
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.options import JsonOption
from boltpose.cli.outputs import check_output
from boltpose.errors import InputFileError

if TYPE_CHECKING:
    from boltpose.cell import CellFile
    from boltpose.cell.check import Finding

_FILE = "boltpose.toml"
_INK = {"ok": "green", "warn": "yellow", "fail": "bold red"}


def init(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Where to write it.")
    ] = Path(_FILE),
) -> None:
    """Write a settings file with every key and its default, commented out."""
    check_output(output, (".toml",))
    if output.exists():
        raise InputFileError(output, "a file already", "a new name, or edit the one there")

    from boltpose.cell.template import settings_template
    from boltpose.io.atomic import write_atomic

    content = settings_template(_kinds()).encode()
    write_atomic(output, lambda stream: _put(stream, content))
    answer_json({"file": str(output)})
    note(f"wrote {output}")


def check(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="By default the one that `locate` would use."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Test everything the settings name: files, ranges, the service's address; exit 2 on a fail."""
    from boltpose.cli.config_check import check_cell

    cell = _require_cell(file)
    findings = list(check_cell(cell, _kinds()))
    has_failed = any(finding.level == "fail" for finding in findings)
    if as_json:
        found = [
            {"section": f.section, "key": f.key, "level": f.level.value, "text": f.text}
            for f in findings
        ]
        data = {"file": str(cell.path), "ok": not has_failed, "findings": found}
        typer.echo(json.dumps(data, indent=2))
    else:
        _print(cell, findings)
    if has_failed:
        raise typer.Exit(ExitCode.BAD_INPUT)


def show(config: ConfigOption = None, as_json: JsonOption = False) -> None:
    """Show every setting that counts here, and where it comes from."""
    from boltpose.cli.cell import open_cell

    cell = open_cell(config)
    data: dict[str, dict[str, dict[str, Any]]] = {}
    for section, kind in _kinds().items():
        settings = cell.settings(section, kind)
        said = {} if cell.file is None else cell.file.tables.get(section, {})
        data[section] = {
            field.name: {
                "value": _plain(field.name, getattr(settings, field.name)),
                "from": "file" if field.name in said else "default",
            }
            for field in fields(kind)
        }
    if as_json:
        path = None if cell.file is None else str(cell.file.path)
        typer.echo(json.dumps({"file": path, **data}, indent=2))
        return
    console = answer_console()
    for section, keys in data.items():
        console.print(f"[bold]\\[{section}][/]")
        for key, entry in keys.items():
            mark = "[bold]" if entry["from"] == "file" else "[dim]"
            text = json.dumps(entry["value"])
            console.print(f"{mark}{key} = [/]", end="")
            console.print(f"{text}   ({entry['from']})", markup=False, soft_wrap=True)


def _kinds() -> dict[str, type]:
    from boltpose.cell import LocateSection
    from boltpose.robot import RobotConfig
    from boltpose.service.config import ServiceConfig
    from boltpose.viewer.config import ViewerConfig

    return {
        "locate": LocateSection,
        "robot": RobotConfig,
        "service": ServiceConfig,
        "viewer": ViewerConfig,
    }


def _require_cell(file: Path | None) -> CellFile:
    from boltpose.cell import find_cell, read_cell

    found = find_cell(file, os.environ, Path.cwd())
    if found is None:
        raise InputFileError(
            _FILE, "no such file here, and no BOLTPOSE_CONFIG", "`boltpose config init` makes one"
        )
    return read_cell(found[0])


def _print(cell: CellFile, findings: list[Finding]) -> None:
    console = answer_console()
    console.print(str(cell.path), markup=False, soft_wrap=True)
    for finding in findings:
        where = f"\\[{finding.section}] {finding.key}".rstrip()
        console.print(f"[{_INK[finding.level]}]{finding.level.value:5}[/]{where}: ", end="")
        console.print(finding.text, markup=False, soft_wrap=True)


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    if name == "database" and value is not None:
        word = urlsplit(value).password  # what is shown is copied into mails
        return value if word is None else value.replace(f":{word}@", ":***@")
    return list(value) if isinstance(value, tuple) else value


def _put(stream: Any, content: bytes) -> None:
    stream.write(content)
