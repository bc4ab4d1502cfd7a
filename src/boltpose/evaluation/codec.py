"""Records to JSON and back, by their field types; anything unexpected is an error."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from enum import Enum
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

Record = TypeVar("Record")


def encode(value: Any) -> Any:
    """Turn a record into JSON-ready data.

    Args:
        value: A dataclass of plain numbers, texts, enums, tuples, mappings and such dataclasses.

    Returns:
        Dicts, lists, numbers and texts.

    Raises:
        TypeError: A value has no JSON form here, an array for example.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: encode(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        items = cast("Mapping[Any, Any]", value)
        return {str(key): encode(item) for key, item in items.items()}
    if isinstance(value, tuple | list):
        return [encode(item) for item in cast("list[Any]", value)]
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise TypeError(f"{type(value).__name__} has no JSON form in a record")


def decode(kind: type[Record], data: Any) -> Record:
    """Build a record from what `encode` made of one.

    Args:
        kind: The dataclass.
        data: JSON data.

    Returns:
        The record.

    Raises:
        ValueError: A field is missing, unknown or of another type.
    """
    return cast("Record", _decode(kind, data, kind.__name__))


def _decode(kind: Any, data: Any, where: str) -> Any:
    origin = get_origin(kind)
    if origin in (Union, types.UnionType):
        choices = [choice for choice in get_args(kind) if choice is not type(None)]
        return None if data is None else _decode(choices[0], data, where)
    if origin is tuple:
        if not isinstance(data, list):
            raise ValueError(f"{where} must be a list, got {type(data).__name__}")
        item = get_args(kind)[0]
        items = cast("list[Any]", data)
        return tuple(_decode(item, entry, f"{where}[{i}]") for i, entry in enumerate(items))
    if origin is Mapping:
        if not isinstance(data, dict):
            raise ValueError(f"{where} must be an object, got {type(data).__name__}")
        value = get_args(kind)[1]
        entries = cast("dict[str, Any]", data)
        return {key: _decode(value, entry, f"{where}.{key}") for key, entry in entries.items()}
    if dataclasses.is_dataclass(kind):
        return _decode_dataclass(cast("type[Any]", kind), data, where)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(data)
    if kind is float and isinstance(data, int) and not isinstance(data, bool):
        return float(data)
    if type(data) is not kind:
        raise ValueError(f"{where} must be {kind.__name__}, got {type(data).__name__}")
    return data


def _decode_dataclass(kind: type[Any], data: Any, where: str) -> Any:
    if not isinstance(data, dict):
        raise ValueError(f"{where} must be an object, got {type(data).__name__}")
    entries = cast("dict[str, Any]", data)
    hints = get_type_hints(kind)
    names = {f.name for f in dataclasses.fields(kind)}
    if set(entries) != names:
        raise ValueError(
            f"{where} must have the fields {sorted(names)}, differs by "
            f"{sorted(set(entries) ^ names)}"
        )
    return kind(**{name: _decode(hints[name], entries[name], f"{where}.{name}") for name in names})
