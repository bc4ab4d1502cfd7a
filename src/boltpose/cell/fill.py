"""A table of a settings file -> a frozen dataclass, with errors that name file and key."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from pydantic import TypeAdapter, ValidationError

from boltpose.cell.slips import did_you_mean
from boltpose.errors import BoltposeError, InputFileError

SettingsT = TypeVar("SettingsT")
_WANTED = {
    "tuple_type": "a list in brackets, like [1.0, 2.0]",
    "missing": "more values in the list",
    "too_long": "fewer values in the list",
}
"""Where pydantic speaks to programmers; by its type of error."""


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


def _typed(path: Path, section: str, key: str, value: Any, hint: Any) -> Any:
    try:
        # strict for JSON: a list may become a tuple and a word a name, but "5" is no number
        return TypeAdapter(hint).validate_json(json.dumps(value), strict=True)
    except TypeError as error:  # a date or a time
        raise InputFileError(path, f"[{section}] {key} = {value}", "no date") from error
    except ValidationError as error:
        first = error.errors()[0]
        wanted = _WANTED.get(first["type"]) or first["msg"].removeprefix("Input should be ")
        raise InputFileError(path, f"[{section}] {key} = {value!r}", wanted) from error
