"""Find 4x4 matrices in YAML, JSON and CSV text; only plain data is ever constructed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import yaml

from boltpose.arrays import FloatArray
from boltpose.errors import InputFileError

_MAX_BYTES = 1_000_000
_MAX_NODES = 20_000
_CSV_SUFFIXES = (".csv", ".txt")
_YAML_SUFFIXES = (".yaml", ".yml")
_CONTAINER_KEYS = frozenset({"data", "floatmatrix", "matrix"})
"""Keys that say how, not what; the key above them names the matrix."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FoundMatrix:
    """A 4x4 in a document."""

    key: str
    """The nearest key above it that says what it is; empty where there is none."""
    matrix: FloatArray
    """Shape (4, 4), row-major as written."""


class _Loader(yaml.SafeLoader):
    """Plain data, and OpenCV's matrices as plain mappings."""


def _construct_opencv_matrix(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _construct_opencv_matrix)


def parse_document(path: Path, wanted: str) -> Any:
    """Read a small text file as nested lists, mappings and scalars.

    Args:
        path: A `.yaml`, `.yml`, `.json`, `.csv` or `.txt` file.
        wanted: What the caller reads, for the error text.

    Returns:
        The document; a CSV file becomes the flat list of its numbers.

    Raises:
        InputFileError: The suffix is another one or the file is larger than 1 MB.
        Exception: Whatever the parser raises; call this within `refusing`.
    """
    suffix = path.suffix.lower()
    if suffix not in (*_YAML_SUFFIXES, ".json", *_CSV_SUFFIXES):
        raise InputFileError(path, f"the suffix '{path.suffix}'", wanted)
    if path.stat().st_size > _MAX_BYTES:
        raise InputFileError(path, "more than 1 MB", wanted)
    text = path.read_text(encoding="utf-8-sig")
    if suffix == ".json":
        return json.loads(text)
    if suffix in _YAML_SUFFIXES:
        # OpenCV's first line '%YAML:1.0' is no legal YAML directive
        return yaml.load(re.sub(r"\A%YAML:1\.0[^\n]*\n", "", text), Loader=_Loader)
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    return [float(word) for word in re.split(r"[\s,;\[\]]+", "\n".join(lines)) if word]


def find_matrices(document: Any) -> list[FoundMatrix]:
    """Find every 4x4 in a document.

    Args:
        document: Nested lists and mappings. A 4x4 is 4 rows of 4 numbers, 16 numbers in a row
            by themselves or under `data` beside `rows` and `cols` of 4 (OpenCV).

    Returns:
        The matrices in the order of the document.

    Raises:
        ValueError: The document is absurdly large or holds itself.
    """
    found: list[FoundMatrix] = []
    for key, node in _walk(document):
        matrix = _as_matrix(node)
        if matrix is not None:
            found.append(FoundMatrix(key=key, matrix=matrix))
    return found


def find_residuals(document: Any) -> list[tuple[float, float]]:
    """Find Zivid's `per_pose_residuals`.

    Returns:
        (rotation in degrees, translation in mm) of every calibration pose; empty without any.

    Raises:
        ValueError: An entry lacks one of the two numbers, or one is negative or not finite.
    """
    residuals: list[tuple[float, float]] = []
    for _, node in _walk(document):
        if not isinstance(node, dict):
            continue
        mapping = cast(dict[Any, Any], node)
        for entry in mapping.get("per_pose_residuals") or []:
            try:
                pair = (float(entry["rotation_deg"]), float(entry["translation_mm"]))
            except (KeyError, TypeError) as error:
                raise ValueError(
                    f"a residual without rotation_deg or translation_mm ({error})"
                ) from None
            if not (0 <= pair[0] < np.inf and 0 <= pair[1] < np.inf):
                raise ValueError(f"the residual {pair}")
            residuals.append(pair)
    return residuals


def _walk(document: Any) -> Iterator[tuple[str, Any]]:
    """Visit every list and mapping, with the key that names it; matrices are not entered."""
    stack: list[tuple[str, Any]] = [("", document)]
    visits = 0
    while stack:
        visits += 1
        # YAML aliases make small files explode
        if visits + len(stack) > _MAX_NODES:
            raise ValueError(f"a document of more than {_MAX_NODES} nodes")
        key, node = stack.pop()
        yield key, node
        if _as_matrix(node) is not None:
            continue
        children: list[tuple[str, Any]] = []
        if isinstance(node, dict):
            for name, child in cast(dict[Any, Any], node).items():
                is_container = str(name).lower() in _CONTAINER_KEYS
                children.append((key if is_container else str(name), child))
        elif isinstance(node, list):
            children = [(key, child) for child in cast(list[Any], node)]
        # only what can hold a matrix; last in, first out
        stack += [child for child in reversed(children) if isinstance(child[1], (dict, list))]


def _as_matrix(node: Any) -> FloatArray | None:
    """Return the 4x4 a node is, or None."""
    if isinstance(node, dict):
        mapping = cast(dict[Any, Any], node)
        if mapping.get("rows") != 4 or mapping.get("cols") != 4:
            return None
        node = mapping.get("data")
    values = _as_list(node)
    rows = [_as_list(row) for row in values]
    if [len(row) for row in rows] == [4, 4, 4, 4]:
        values = [value for row in rows for value in row]
    if len(values) != 16:
        return None
    numbers = [number for number in map(_as_number, values) if number is not None]
    return np.array(numbers).reshape(4, 4) if len(numbers) == 16 else None


def _as_list(node: Any) -> list[Any]:
    """Return a list as it is and anything else as an empty one."""
    return cast(list[Any], node) if isinstance(node, list) else []


def _as_number(value: Any) -> float | None:
    """Return a number, or None; PyYAML takes `1e-05`, without a point, for text."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return float(value)
    except ValueError:
        return None
