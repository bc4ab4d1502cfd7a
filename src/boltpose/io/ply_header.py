"""The header of a PLY file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from boltpose.errors import InputFileError
from boltpose.io.guard import MAX_POINTS

PLY_WANTED = "a PLY file, ascii or binary, with vertex properties x, y, z"

_MAX_LINES = 10_000
_MAX_LINE_BYTES = 65_536
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlyProperty:
    """One property of an element."""

    name: str
    dtype: str
    """numpy type with byte order, of the value or of a list's items."""
    count_dtype: str | None = None
    """numpy type of a list's length; None for a plain value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlyElement:
    """One table of the file."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]

    @property
    def has_lists(self) -> bool:
        """True if rows differ in length."""
        return any(prop.count_dtype is not None for prop in self.properties)

    @property
    def plain_dtype(self) -> list[tuple[str, str]]:
        """The numpy row type of the plain properties."""
        return [(prop.name, prop.dtype) for prop in self.properties if prop.count_dtype is None]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlyHeader:
    """What the text at the start of a PLY file declares."""

    is_ascii: bool
    elements: tuple[PlyElement, ...]
    body_start: int
    """Offset in bytes of the first row."""


def read_ply_header(path: Path, stream: BinaryIO) -> PlyHeader:
    """Parse the header and leave the stream at the first row.

    Args:
        path: The file, for the error text.
        stream: The file, opened for reading bytes, at its start.

    Returns:
        The header. Element `vertex` is in it exactly once.

    Raises:
        InputFileError: It is no PLY, or the header is broken or claims too many points.
    """
    if stream.readline(_MAX_LINE_BYTES).rstrip() != b"ply":
        raise InputFileError(path, "no 'ply' in the first line", PLY_WANTED)
    byte_order: str | None = None
    elements: list[PlyElement] = []
    for _ in range(_MAX_LINES):
        line = stream.readline(_MAX_LINE_BYTES)
        if not line.endswith(b"\n"):
            break
        words = line.decode("latin-1").split()
        match words:
            case ["end_header"]:
                if byte_order is None:
                    raise InputFileError(path, "a header without a format line", PLY_WANTED)
                _check_elements(path, elements)
                return PlyHeader(
                    is_ascii=byte_order == "",
                    elements=tuple(elements),
                    body_start=stream.tell(),
                )
            case [] | ["comment", *_] | ["obj_info", *_]:
                continue
            case ["format", name, _] if name in _BYTE_ORDERS and byte_order is None:
                byte_order = _BYTE_ORDERS[name]
            case ["element", name, count] if count.isdecimal():
                elements.append(PlyElement(name=name, count=int(count), properties=()))
            case ["property", *rest] if elements and byte_order is not None:
                elements[-1] = _with_property(path, elements[-1], rest, byte_order)
            case _:
                raise InputFileError(path, f"header line '{' '.join(words)[:80]}'", PLY_WANTED)
    raise InputFileError(path, "a header without 'end_header'", PLY_WANTED)


def _with_property(
    path: Path, element: PlyElement, words: list[str], byte_order: str
) -> PlyElement:
    """Append the property that a header line declares."""
    match words:
        case ["list", count_type, item_type, name] if {count_type, item_type} <= _TYPES.keys():
            count_dtype = _TYPES[count_type]
            if count_dtype[0] == "f":
                raise InputFileError(path, f"list length of type {count_type}", "an integer type")
            added = PlyProperty(
                name=name,
                dtype=byte_order + _TYPES[item_type],
                count_dtype=byte_order + count_dtype,
            )
        case [value_type, name] if value_type in _TYPES:
            added = PlyProperty(name=name, dtype=byte_order + _TYPES[value_type])
        case _:
            raise InputFileError(path, f"property '{' '.join(words)[:80]}'", PLY_WANTED)
    if any(prop.name == added.name for prop in element.properties):
        raise InputFileError(path, f"property '{added.name}' twice", "different names")
    return PlyElement(
        name=element.name, count=element.count, properties=(*element.properties, added)
    )


def _check_elements(path: Path, elements: list[PlyElement]) -> None:
    """Refuse headers that cannot belong to a scan."""
    vertices = [element for element in elements if element.name == "vertex"]
    if len(vertices) != 1:
        raise InputFileError(path, f"{len(vertices)} elements 'vertex'", PLY_WANTED)
    for element in elements:
        if element.count > MAX_POINTS:
            found = f"a header with {element.count} rows of '{element.name}'"
            raise InputFileError(path, found, f"at most {MAX_POINTS}")
