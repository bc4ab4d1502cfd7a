"""Reads `boltpose.toml`: sections into the frozen settings of their stages."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from boltpose.cell.fill import fill_settings
from boltpose.cell.locate_section import LocateSection
from boltpose.cell.slips import did_you_mean
from boltpose.errors import ConfigError, InputFileError
from boltpose.io.guard import require_file

FILE_NAME = "boltpose.toml"
SECTIONS = ("locate", "robot", "service", "viewer")
"""What a file may hold; the settings of the last three belong to the packages of these names."""
_PATH_KEYS: dict[str, tuple[str, ...]] = {
    "locate": ("prior", "hand_eye", "camera", "models"),
    "robot": ("tcp",),
    "service": ("data", "priors", "scans", "models"),
    "viewer": (),
}
"""Keys whose values are paths, relative to the file."""
COMMAND_LINE_ONLY = {"robot": ("include_contradicted",)}
"""What a person has to ask for every time: a tool at a place where no bolt is does damage."""
_WANTED = f"a settings file with {', '.join(f'[{name}]' for name in SECTIONS)}"

SettingsT = TypeVar("SettingsT")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CellFile:
    """A `boltpose.toml` whose sections are known by name; their keys are checked when asked for."""

    path: Path
    """Absolute."""
    sha256: str
    tables: Mapping[str, Mapping[str, Any]]
    """By section, as the file has it."""

    def settings(self, section: str, kind: type[SettingsT]) -> SettingsT:
        """Make the settings of a section; what it does not say has its default.

        Args:
            section: One of `SECTIONS`.
            kind: The frozen dataclass of its settings.

        Raises:
            InputFileError: A key is unknown, or a value of the wrong type or out of range. The
                text names file, section and key.
        """
        table = dict(self.tables.get(section, {}))
        for key in COMMAND_LINE_ONLY.get(section, ()):
            if key in table:
                raise InputFileError(
                    self.path, f"[{section}] {key}", "that on the command line only"
                )
        defaults = {field.name: field.default for field in fields(kind)}  # pyright: ignore[reportArgumentType]
        for key in _PATH_KEYS[section]:
            if isinstance(defaults.get(key), str):
                # a folder by default lies beside the file too, wherever the command is called
                table.setdefault(key, defaults[key])
            if table.get(key) == "":  # pathlib takes it for the folder of the command
                raise InputFileError(
                    self.path, f"[{section}] {key} = ''", "a path, or # before the line"
                )
            if isinstance(table.get(key), str):
                # expanduser: a file is not read by a shell
                table[key] = str(self.path.parent / Path(table[key]).expanduser())
        return fill_settings(self.path, section, table, kind)

    def locate(self) -> LocateSection:
        """Settings of `boltpose locate`; raises as `settings`."""
        return self.settings("locate", LocateSection)


def find_cell(
    given: Path | None, environment: Mapping[str, str], folder: Path
) -> tuple[Path, str] | None:
    """Say which settings file counts, and why.

    Folders above `folder` are not searched: a file that nobody thinks of must not change where a
    robot goes.

    Args:
        given: That of the command line.
        environment: `BOLTPOSE_CONFIG` is looked up there.
        folder: Where the command was called.

    Returns:
        The file and what named it; None if there is none.
    """
    if given is not None:
        return given, "--config"
    named = environment.get("BOLTPOSE_CONFIG", "")
    if named:
        return Path(named), "BOLTPOSE_CONFIG"
    beside = folder / FILE_NAME
    return (beside, "this folder") if beside.is_file() else None


def read_cell(path: str | Path) -> CellFile:
    """Read a settings file.

    Raises:
        InputFileError: The file is missing, no TOML, or has an unknown section.
    """
    source = require_file(Path(path), _WANTED).resolve()
    content = source.read_bytes()
    try:
        data = tomllib.loads(content.decode("utf-8-sig"))  # Notepad puts a mark in front
    except UnicodeDecodeError as error:
        raise InputFileError(path, "bytes that are no UTF-8", _WANTED) from error
    except tomllib.TOMLDecodeError as error:
        hint = "; write paths with / or in 'single quotes'" if "\\" in str(error) else ""
        raise InputFileError(path, f"no TOML ({error}){hint}", _WANTED) from error
    for name, table in data.items():
        if name in SECTIONS and isinstance(table, dict):
            continue
        found = f"section [{name}]" if isinstance(table, dict) else f"key '{name}' in no section"
        raise InputFileError(path, found + did_you_mean(name, SECTIONS), _WANTED)
    return CellFile(path=source, sha256=sha256(content).hexdigest(), tables=data)


def require_prior(section: LocateSection, given: Path | None) -> Path:
    """The prior of the command line, else that of the file.

    Raises:
        ConfigError: There is neither.
    """
    prior = given or section.prior
    if prior is None:
        raise ConfigError(
            "no prior: give --prior FILE|DIR, or name it under [locate] in boltpose.toml"
        )
    return prior
