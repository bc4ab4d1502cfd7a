"""Scans in PLY files: ascii and both binary byte orders, any property order and type."""

from __future__ import annotations

import io
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from boltpose.arrays import AnyArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.io.guard import refusing
from boltpose.io.ply_header import (
    PLY_WANTED,
    PlyElement,
    PlyHeader,
    read_ply_header,
)
from boltpose.io.raw import RawCloud, assemble_columns, read_table, typed_column


def read_ply(path: Path) -> RawCloud:
    """Read the vertices of a PLY file; faces and other elements are skipped.

    Args:
        path: The file. Vertex properties read: `x y z`, `red green blue` (or `r g b`,
            `diffuse_*`), `nx ny nz`, `label` (or `scalar_label`).

    Returns:
        The cloud, in the file's unit.

    Raises:
        InputFileError: It is no PLY, broken, or shorter or longer than its header says.

    Source:
        G. Turk, The PLY Polygon File Format, 1994.
    """
    with refusing(path, PLY_WANTED), path.open("rb") as stream:
        header = read_ply_header(path, stream)
        if header.is_ascii:
            # PLY is ascii by its definition; latin-1 maps every byte, so that none can fail here
            with io.TextIOWrapper(stream, encoding="latin-1") as text:
                columns = _read_ascii(path, header, text)
        else:
            columns = _read_binary(path, header, np.fromfile(stream, dtype=np.uint8))
        return assemble_columns(path, columns)


def _read_ascii(path: Path, header: PlyHeader, text: io.TextIOWrapper) -> dict[str, AnyArray]:
    """Parse the rows of an ascii body; one row is one line."""
    text.seek(header.body_start)
    lines = filter(str.strip, text)
    columns: dict[str, AnyArray] = {}
    for element in header.elements:
        rows = islice(lines, element.count)
        if element.name == "vertex":
            plain = [prop for prop in element.properties if prop.count_dtype is None]
            table = read_table(_drop_lists(rows, element) if element.has_lists else rows)
            found = len(table)
            if found and table.shape[1] != len(plain):
                found_text = f"{table.shape[1]} values in a vertex row"
                raise InputFileError(path, found_text, f"{len(plain)} as in the header")
            if found:
                columns = {
                    prop.name: typed_column(path, prop.name, table[:, index], prop.dtype)
                    for index, prop in enumerate(plain)
                }
        else:
            found = sum(1 for _ in rows)
        if found != element.count:
            found_text = f"{found} rows of '{element.name}'"
            raise InputFileError(path, found_text, f"{element.count} as in the header")
    if next(lines, None) is not None:
        raise InputFileError(path, "more rows than the header says", PLY_WANTED)
    return columns


def _drop_lists(lines: Iterator[str], element: PlyElement) -> Iterator[str]:
    """Remove the list properties from ascii rows."""
    for line in lines:
        words = line.split()
        kept: list[str] = []
        at = 0
        for prop in element.properties:
            if prop.count_dtype is None:
                kept.append(words[at])
                at += 1
            else:
                at += 1 + int(words[at])
        if at != len(words):
            raise ValueError(f"{len(words)} values in a row that should have {at}")
        yield " ".join(kept)


def _read_binary(path: Path, header: PlyHeader, body: UInt8Array) -> dict[str, AnyArray]:
    """Cut the elements out of a binary body."""
    columns: dict[str, AnyArray] = {}
    at = 0
    for element in header.elements:
        if element.has_lists:
            rows, at = _read_list_rows(path, element, body, at)
        else:
            dtype = np.dtype(element.plain_dtype)
            end = at + element.count * dtype.itemsize
            _check_length(path, element, body, end)
            rows, at = body[at:end].view(dtype) if end > at else None, end
        if element.name == "vertex" and rows is not None:
            columns = {name: rows[name] for name in rows.dtype.names or ()}
    # a header that says too little would drop points without a word
    if np.isin(body[at:], np.frombuffer(b" \r\n\0", dtype=np.uint8), invert=True).any():
        found = f"{len(body) - at} bytes more than the header says"
        raise InputFileError(path, found, PLY_WANTED)
    return columns


def _read_list_rows(
    path: Path, element: PlyElement, body: UInt8Array, start: int
) -> tuple[AnyArray | None, int]:
    """Read rows that hold lists; returns the plain properties and the offset behind the rows."""
    if element.count == 0:
        return None, start
    # nearly always every list has the same length (triangles): then the rows are a table
    dtype = _row_dtype_like_first(path, element, body, start)
    end = start + element.count * dtype.itemsize
    if end <= len(body):
        rows = body[start:end].view(dtype)
        counts = [name for name in dtype.names or () if name.startswith("#")]
        if all((rows[name] == rows[name][0]).all() for name in counts):
            return rows, end
    return _walk_list_rows(path, element, body, start)


def _row_dtype_like_first(
    path: Path, element: PlyElement, body: UInt8Array, start: int
) -> np.dtype[np.void]:
    """Build the row type that holds if every list is as long as in the first row."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    at = start
    for prop in element.properties:
        if prop.count_dtype is None:
            fields.append((prop.name, prop.dtype))
            at += np.dtype(prop.dtype).itemsize
            continue
        count_type = np.dtype(prop.count_dtype)
        _check_length(path, element, body, at + count_type.itemsize)
        length = int(body[at : at + count_type.itemsize].view(count_type)[0])
        size = np.dtype(prop.dtype).itemsize * length
        if length < 0 or at + count_type.itemsize + size > len(body):
            raise InputFileError(path, f"a list of length {length}", PLY_WANTED)
        # '#' starts no property name that PLY writers use; it only has to differ
        fields.append((f"#{prop.name}", prop.count_dtype))
        fields.append((f"*{prop.name}", prop.dtype, (length,)))
        at += count_type.itemsize + size
    return np.dtype(fields)


def _walk_list_rows(
    path: Path, element: PlyElement, body: UInt8Array, start: int
) -> tuple[AnyArray | None, int]:
    """Read rows whose lists differ in length, one by one."""
    data = body.data
    plain = bytearray()
    at = start
    for _ in range(element.count):
        for prop in element.properties:
            if prop.count_dtype is None:
                size = int(prop.dtype[-1])
                plain += data[at : at + size]
            else:
                width = int(prop.count_dtype[-1])
                order = "big" if prop.count_dtype[0] == ">" else "little"
                is_signed = "i" in prop.count_dtype
                length = int.from_bytes(data[at : at + width], order, signed=is_signed)
                if length < 0:
                    raise InputFileError(path, f"a list of length {length}", PLY_WANTED)
                size = width + length * int(prop.dtype[-1])
            at += size
        if at > len(body):
            break
    _check_length(path, element, body, at)
    dtype = np.dtype(element.plain_dtype)
    return (np.frombuffer(plain, dtype=dtype) if dtype.itemsize else None), at


def _check_length(path: Path, element: PlyElement, body: UInt8Array, end: int) -> None:
    """Refuse a body that stops before an element's end."""
    if end > len(body):
        found = f"a body of {len(body)} bytes that ends within element '{element.name}'"
        raise InputFileError(path, found, f"{element.count} rows as in the header")
