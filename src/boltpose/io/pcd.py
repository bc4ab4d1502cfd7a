"""Scans in PCD files: ascii, binary and binary_compressed, fields in any order."""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.arrays import AnyArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.io.guard import MAX_POINTS, refusing
from boltpose.io.lzf import decompress_lzf
from boltpose.io.raw import RawCloud, assemble_columns, read_table, typed_column

_WANTED = "a PCD file, ascii, binary or binary_compressed, with fields x, y, z"
_MAX_LINES = 1000
_MAX_LINE_BYTES = 65_536
_TYPES = {
    ("F", "4"): "<f4",
    ("F", "8"): "<f8",
    **{("I", str(size)): f"<i{size}" for size in (1, 2, 4, 8)},
    **{("U", str(size)): f"<u{size}" for size in (1, 2, 4, 8)},
}
_REQUIRED = ("FIELDS", "SIZE", "TYPE", "WIDTH", "HEIGHT", "DATA")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Field:
    """One field of a point."""

    name: str
    dtype: str
    count: int

    @property
    def size(self) -> int:
        """Bytes of the field in one point."""
        return int(self.dtype[-1]) * self.count


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    """What the text at the start of a PCD file declares."""

    fields: tuple[_Field, ...]
    width: int
    height: int
    encoding: str

    @property
    def count(self) -> int:
        """Number of points."""
        return self.width * self.height

    @property
    def point_size(self) -> int:
        """Bytes of one point."""
        return sum(field.size for field in self.fields)


def read_pcd(path: Path) -> RawCloud:
    """Read a PCD file.

    Args:
        path: The file. Fields read: `x y z`, packed `rgb` or `rgba` (or `r g b`),
            `normal_x normal_y normal_z`, `label`; others are skipped. HEIGHT > 1 means organised.
            VIEWPOINT is not applied: PCL keeps the points in the sensor's frame too.

    Returns:
        The cloud, in the file's unit.

    Raises:
        InputFileError: It is no PCD, broken, or shorter or longer than its header says.

    Source:
        The PCD file format, version 0.7, documentation of the Point Cloud Library.
    """
    with refusing(path, _WANTED), path.open("rb") as stream:
        header = _read_header(path, stream)
        if header.encoding == "ascii":
            with io.TextIOWrapper(stream, encoding="latin-1") as text:
                text.seek(stream.tell())
                columns = _read_ascii(path, header, text)
        else:
            body = np.fromfile(stream, dtype=np.uint8)
            read = _read_binary if header.encoding == "binary" else _read_compressed
            columns = read(path, header, body)
        columns |= _unpack_rgb(header, columns)
        grid_shape = (header.height, header.width) if header.height > 1 else None
        return assemble_columns(path, columns, grid_shape=grid_shape)


def _read_header(path: Path, stream: BinaryIO) -> _Header:
    """Parse the header and leave the stream at the first point."""
    entries: dict[str, list[str]] = {}
    for _ in range(_MAX_LINES):
        line = stream.readline(_MAX_LINE_BYTES)
        words = line.decode("latin-1").split()
        if not line:
            break
        if not words or words[0].startswith("#"):
            continue
        entries[words[0]] = words[1:]
        if words[0] == "DATA":
            break
    missing = [name for name in _REQUIRED if not entries.get(name)]
    if missing:
        raise InputFileError(path, f"a header without {', '.join(missing)}", _WANTED)
    fields = _read_fields(path, entries)
    (width,), (height,) = (map(int, entries[name]) for name in ("WIDTH", "HEIGHT"))
    points = entries.get("POINTS", [str(width * height)])
    if points != [str(width * height)]:
        found = f"POINTS {' '.join(points)} for {width} x {height} points"
        raise InputFileError(path, found, "POINTS = WIDTH x HEIGHT")
    if width < 0 or height < 0 or width * height > MAX_POINTS:
        raise InputFileError(path, f"{width} x {height} points", f"at most {MAX_POINTS}")
    (encoding,) = entries["DATA"]
    if encoding not in ("ascii", "binary", "binary_compressed"):
        raise InputFileError(path, f"DATA {encoding}", _WANTED)
    return _Header(fields=fields, width=width, height=height, encoding=encoding)


def _read_fields(path: Path, entries: dict[str, list[str]]) -> tuple[_Field, ...]:
    """Combine the header's lists about fields."""
    names = entries["FIELDS"]
    counts = entries.get("COUNT", ["1"] * len(names))
    fields: list[_Field] = []
    for name, size, kind, count in zip(
        names, entries["SIZE"], entries["TYPE"], counts, strict=True
    ):
        if (kind, size) not in _TYPES:
            raise InputFileError(path, f"field '{name}' of type {kind}{size}", _WANTED)
        if not 1 <= int(count) <= MAX_POINTS:
            raise InputFileError(path, f"field '{name}' with COUNT {count}", "at least 1")
        fields.append(_Field(name=name, dtype=_TYPES[kind, size], count=int(count)))
    plain = [field.name for field in fields if field.name != "_"]
    if len(set(plain)) != len(plain):
        raise InputFileError(path, f"fields {' '.join(plain)}", "different names")
    return tuple(fields)


def _read_ascii(path: Path, header: _Header, text: io.TextIOWrapper) -> dict[str, AnyArray]:
    """Parse the lines of an ascii body; one point is one line."""
    table = read_table(filter(str.strip, text))
    width = sum(field.count for field in header.fields)
    if table.shape != (header.count, width) and (len(table) or header.count):
        found = f"{table.shape[0]} lines of {table.shape[1]} values"
        raise InputFileError(path, found, f"{header.count} of {width} as in the header")
    columns: dict[str, AnyArray] = {}
    at = 0
    for field in header.fields:
        if field.count == 1 and field.name != "_" and len(table):
            columns[field.name] = typed_column(path, field.name, table[:, at], field.dtype)
        at += field.count
    return columns


def _read_binary(path: Path, header: _Header, body: UInt8Array) -> dict[str, AnyArray]:
    """Cut the fields out of a body that holds point after point."""
    end = header.count * header.point_size
    _check_end(path, body, end)
    names = [f"{index}" for index in range(len(header.fields))]  # padding fields share a name
    formats = [(field.dtype, field.count) for field in header.fields]
    rows = body[:end].view(np.dtype({"names": names, "formats": formats}))
    return {
        field.name: rows[name][:, 0]
        for name, field in zip(names, header.fields, strict=True)
        if field.count == 1 and field.name != "_"
    }


def _read_compressed(path: Path, header: _Header, body: UInt8Array) -> dict[str, AnyArray]:
    """Decompress a body that holds field after field."""
    if len(body) < 8:
        raise InputFileError(path, f"a body of {len(body)} bytes", "at least 8")
    packed_size, size = struct.unpack("<II", body[:8].tobytes())
    if size != header.count * header.point_size:
        found = f"{size} bytes of points"
        raise InputFileError(path, found, f"{header.count} x {header.point_size} as in the header")
    _check_end(path, body, 8 + packed_size)
    data = decompress_lzf(body[8 : 8 + packed_size].tobytes(), size)
    columns: dict[str, AnyArray] = {}
    at = 0
    for field in header.fields:
        end = at + header.count * field.size
        if field.count == 1 and field.name != "_":
            columns[field.name] = data[at:end].view(field.dtype)
        at = end
    return columns


def _check_end(path: Path, body: UInt8Array, end: int) -> None:
    """Refuse a body that is shorter or longer than the header says; zeros and blanks may follow."""
    rest = body[end:]
    is_longer = np.isin(rest, np.frombuffer(b" \r\n\0", dtype=np.uint8), invert=True).any()
    if end > len(body) or is_longer:
        raise InputFileError(path, f"a body of {len(body)} bytes", f"{end} as in the header")


def _unpack_rgb(header: _Header, columns: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """Split the packed colour, 0xAARRGGBB, whose bits PCL stores as a float or an integer."""
    name = next((name for name in ("rgb", "rgba") if name in columns), None)
    if name is None:
        return {}
    packed = columns[name]
    if packed.dtype.kind != "f":
        bits = packed.astype(np.uint32)
    elif header.encoding == "ascii":
        # written either as the float or as the integer that its bits mean; a float whose bits
        # are a colour is tiny, huge, negative or NaN, never a whole number in between
        is_integer = (packed >= 1) & (packed < 2**32) & (packed == np.floor(packed))
        # the values that do not fit the other reading are not used
        with np.errstate(over="ignore", invalid="ignore"):
            as_float = packed.astype(np.float32).view(np.uint32)
        as_integer = np.where(is_integer, packed, 0).astype(np.uint32)
        bits = np.where(np.isnan(packed), 0, np.where(is_integer, as_integer, as_float))
    else:
        bits = np.ascontiguousarray(packed.astype(np.float32)).view(np.uint32)
    shifts = {"r": 16, "g": 8, "b": 0}
    return {key: ((bits >> shift) & 255).astype(np.uint8) for key, shift in shifts.items()}
