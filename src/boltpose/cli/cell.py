"""Which `boltpose.toml` a command goes by; the command line wins over it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from boltpose.cli.console import note

if TYPE_CHECKING:
    from boltpose.cell import CellFile, LocateSection

SettingsT = TypeVar("SettingsT")

ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE",
        help="Settings of the cell; by default $BOLTPOSE_CONFIG, else ./boltpose.toml if it is "
        "there. /dev/null for none.",
    ),
]


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """The settings of the cell, or all defaults."""

    file: CellFile | None

    def locate(self) -> LocateSection:
        """Settings of `boltpose locate`."""
        from boltpose.cell import LocateSection

        return LocateSection() if self.file is None else self.file.locate()

    def settings(self, section: str, kind: type[SettingsT]) -> SettingsT:
        """Settings of another section."""
        return kind() if self.file is None else self.file.settings(section, kind)

    def provenance(self) -> dict[str, Any]:
        """What a result says of it."""
        if self.file is None:
            return {}
        return {"settings_file": self.file.path.name, "settings_sha256": self.file.sha256}


def open_cell(config: Path | None) -> Cell:
    """Read the settings file that counts, and say on stderr which it is.

    Raises:
        InputFileError: A file was named, or is there, and cannot be used.
    """
    if config is not None and str(config) == os.devnull:
        return Cell(None)
    from boltpose.cell import find_cell, read_cell

    found = find_cell(config, os.environ, Path.cwd())
    if found is None:
        return Cell(None)
    path, why = found
    cell = Cell(read_cell(path))
    note(f"settings from {path} ({why})")
    return cell
