"""A table of a settings file -> a frozen dataclass, with errors that name file and key."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from pydantic import TypeAdapter, ValidationError

from boltpose.errors import BoltposeError, InputFileError

SettingsT = TypeVar("SettingsT")


def fill_settings(
    path: Path, section: str, table: Mapping[str, Any], kind: type[SettingsT]
) -> SettingsT:
    """Fill a frozen dataclass from a table.

    Args:
        path: The file, for messages.
        section: The table's name, for messages.
        table: Keys and values as TOML has them.
        kind: A keyword-only dataclass whose `__post_init__` checks ranges.

    Raises:
        InputFileError: A key is unknown, or a value of the wrong type or out of range.
    """
    hints = get_type_hints(kind)
    names = tuple(field.name for field in fields(kind))  # pyright: ignore[reportArgumentType]
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in names:
            found = f"unknown key '{key}' in [{section}]{did_you_mean(key, names)}"
            raise InputFileError(path, found, f"one of {', '.join(names)}")
        values[key] = _typed(path, section, key, value, hints[key])
    try:
        return kind(**values)
    except BoltposeError as error:
        raise InputFileError(path, f"[{section}] {error}", "a value in its range") from error


def did_you_mean(name: str, known: Sequence[str]) -> str:
    """Return ` (did you mean 'x'?)` for a slip of the keyboard, or nothing."""
    near = get_close_matches(name, known, n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def _typed(path: Path, section: str, key: str, value: Any, hint: Any) -> Any:
    try:
        # strict for JSON: a list may become a tuple and a word a name, but "5" is no number
        return TypeAdapter(hint).validate_json(json.dumps(value), strict=True)
    except TypeError as error:  # a date or a time
        raise InputFileError(path, f"[{section}] {key} = {value}", "no date") from error
    except ValidationError as error:
        first = error.errors()[0]
        wanted = first["msg"].removeprefix("Input should be ")
        raise InputFileError(path, f"[{section}] {key} = {value!r}", wanted) from error
