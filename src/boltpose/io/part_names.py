"""Which class each named part of a CAD model belongs to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, cast

import yaml

from boltpose.errors import ConfigError, InputFileError
from boltpose.io.guard import refusing, require_file
from boltpose.schema import Part

_MAX_BYTES = 1_000_000
_WANTED = "a YAML mapping from part names or patterns to classes, such as `bolt_*: bolt`"


def read_part_names(path: str | Path) -> Mapping[str, Part]:
    """Read which class the parts of a mesh belong to.

    Args:
        path: A YAML file with one mapping from part name, or fnmatch pattern, to class name in
            upper or lower case.

    Returns:
        Pattern to class, in the order of the file.

    Raises:
        InputFileError: The file is missing or broken, no such mapping, or names an unknown class.
    """
    file = require_file(path, _WANTED)
    with refusing(file, _WANTED):
        if file.stat().st_size > _MAX_BYTES:
            raise InputFileError(file, "more than 1 MB", _WANTED)
        document: Any = yaml.safe_load(file.read_text(encoding="utf-8-sig"))
        if not isinstance(document, dict) or not document:
            raise InputFileError(file, "no mapping", _WANTED)
        classes = {part.name.lower(): part for part in Part}
        result: dict[str, Part] = {}
        for pattern, name in cast(dict[Any, Any], document).items():
            if str(name).lower() not in classes:
                found = f"the class '{str(name)[:80]}' for '{pattern}'"
                raise InputFileError(file, found, f"one of {', '.join(classes)}")
            result[str(pattern)] = classes[str(name).lower()]
    return result


def match_part_names(names: Sequence[str], names_to_part: Mapping[str, Part]) -> tuple[Part, ...]:
    """Find the class of every part.

    Args:
        names: The parts of a model.
        names_to_part: Exact names go first, then patterns in their order; case matters.

    Returns:
        One class per name.

    Raises:
        ConfigError: A part matches nothing; the text lists such parts and the patterns.
    """
    parts = [_match(name, names_to_part) for name in names]
    matched = tuple(part for part in parts if part is not None)
    if len(matched) != len(names):
        missing = [name for name, part in zip(names, parts, strict=True) if part is None]
        raise ConfigError(
            f"no class for the parts {', '.join(missing)}; "
            f"the patterns are {', '.join(names_to_part) or 'none'}"
        )
    return matched


def _match(name: str, names_to_part: Mapping[str, Part]) -> Part | None:
    if name in names_to_part:
        return names_to_part[name]
    return next(
        (part for pattern, part in names_to_part.items() if fnmatchcase(name, pattern)), None
    )
