"""The folder of a data set: what it was made with, and who writes to it."""

from __future__ import annotations

import json
import sys
from collections.abc import Generator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any, BinaryIO

import boltpose
from boltpose.errors import ConfigError, InputFileError
from boltpose.io.atomic import write_atomic
from boltpose.synthesis.settings import DataSetSettings
from boltpose.synthesis.write import json_bytes

FORMAT = "boltpose.dataset/1"
SETTINGS_NAME = "dataset.json"
_LOCK_NAME = ".lock"
_WANTED = "the dataset.json of `boltpose synth`"
_PACKAGES = ("numpy", "scipy", "manifold3d", "embreex", "pillow")
"""Whose versions may change the last bits of a sample; noted, not compared."""


def open_folder(root: Path, settings: DataSetSettings) -> None:
    """Make the folder of a data set, or check that it may be continued.

    Args:
        root: Made if missing; otherwise it must be empty or hold a data set of these settings.
        settings: What is to be made.

    Raises:
        ConfigError: The data set was begun with other settings or another version; the text
            says which.
        InputFileError: The folder holds something else, or its `dataset.json` is damaged.
    """
    if root.exists() and not root.is_dir():
        raise InputFileError(root, "a file", "a folder for the data set")
    root.mkdir(parents=True, exist_ok=True)
    path = root / SETTINGS_NAME
    if path.exists():
        _check_same(root, settings)
        return
    others = sorted(entry.name for entry in root.iterdir() if entry.name != _LOCK_NAME)
    if others:
        raise InputFileError(root, f"'{others[0]}' and no {SETTINGS_NAME}", "an empty folder")
    document = {
        "format": FORMAT,
        "settings": settings.to_json(),
        "boltpose": boltpose.__version__,
        "packages": {name: _version(name) for name in _PACKAGES},
    }

    def write(stream: BinaryIO) -> None:
        stream.write(json_bytes(document) + b"\n")

    write_atomic(path, write)


def read_settings(root: Path) -> DataSetSettings:
    """Read the settings of a data set.

    Raises:
        InputFileError: There is no `dataset.json`, or it is damaged or of another format.
    """
    document = _read(root)
    try:
        return DataSetSettings.from_json(document["settings"])
    except (ConfigError, KeyError, TypeError) as error:
        raise InputFileError(root / SETTINGS_NAME, str(error), _WANTED) from error


def read_version(root: Path) -> str:
    """Read which version of this package a data set was made with.

    Raises:
        InputFileError: As `read_settings`.
    """
    return str(_read(root).get("boltpose", "unknown"))


@contextmanager
def locked(root: Path) -> Generator[None]:
    """Keep a second run out of the folder while one is at work.

    The system frees the lock with the process, however that ends.

    Raises:
        InputFileError: Another run is at work there.
    """
    if sys.platform == "win32":  # pragma: no cover  no flock there: whoever comes second is trusted
        yield
        return
    import fcntl

    with (root / _LOCK_NAME).open("ab") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputFileError(root, "another run at work", "one run at a time") from error
        yield


def _read(root: Path) -> dict[str, Any]:
    path = root / SETTINGS_NAME
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputFileError(path, "no such file", _WANTED) from error
    except (OSError, ValueError) as error:
        raise InputFileError(path, f"no readable JSON ({error})", _WANTED) from error
    found = document.get("format") if isinstance(document, dict) else None
    if found != FORMAT:
        raise InputFileError(path, f"format {found!r}", f"'{FORMAT}'")
    return document


def _check_same(root: Path, settings: DataSetSettings) -> None:
    before = read_settings(root).to_json()
    now = settings.to_json()
    changed = [name for name in now if now[name] != before[name]]
    if changed:
        name = changed[0]
        raise ConfigError(
            f"{root} was begun with {name} {before[name]}, now {now[name]} is asked for: "
            "continue with the same settings or take another folder"
        )
    made_by = read_version(root)
    if made_by != boltpose.__version__:
        raise ConfigError(
            f"{root} was begun by boltpose {made_by}, this is {boltpose.__version__}: "
            "take another folder, or the same version"
        )


def _version(package: str) -> str | None:
    try:
        return version_of(package)
    except PackageNotFoundError:
        return None
