"""Write point clouds as PLY."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from boltpose.arrays import AnyArray, as_points
from boltpose.errors import ShapeError
from boltpose.io.atomic import write_atomic

_PLY_TYPES = {"f4": "float", "f8": "double", "u1": "uchar"}
_CHUNK = 65_536


def write_ply(
    path: str | Path,
    points: npt.ArrayLike,
    *,
    labels: npt.ArrayLike | None = None,
    colors: npt.ArrayLike | None = None,
    normals: npt.ArrayLike | None = None,
    binary: bool = True,
) -> None:
    """Write a point cloud as a PLY file that `read_scan` reads back to the same numbers.

    Args:
        path: The file to make or replace.
        points: Shape (N, 3), mm, finite. float32 input becomes `float` properties, any other
            type `double`.
        labels: Shape (N,), 0..255, `uchar label`.
        colors: Shape (N, 3), RGB 0..255, `uchar red green blue`.
        normals: Shape (N, 3), `float` or `double` like the points.
        binary: Little-endian binary if true, else ascii.

    Raises:
        ShapeError: Lengths or shapes differ, a point is not finite or a value is not 0..255.
        OSError: The file cannot be written.
    """
    # asked of the input: as_points makes everything float64
    is_single = np.asarray(points).dtype == np.float32
    real = "<f4" if is_single else "<f8"
    cloud = as_points(points, "points")
    columns: list[tuple[str, str, AnyArray]] = [
        (name, real, cloud[:, i]) for i, name in enumerate("xyz")
    ]
    if normals is not None:
        vectors = _checked(normals, "normals", (len(cloud), 3))
        columns += [(f"n{name}", real, vectors[:, i]) for i, name in enumerate("xyz")]
    if colors is not None:
        rgb = _checked_bytes(colors, "colors", (len(cloud), 3))
        names = ("red", "green", "blue")
        columns += [(name, "<u1", rgb[:, i]) for i, name in enumerate(names)]
    if labels is not None:
        columns.append(("label", "<u1", _checked_bytes(labels, "labels", (len(cloud),))))
    write_ply_columns(path, columns, comment="boltpose, millimetres", binary=binary)


def write_ply_columns(
    path: str | Path,
    columns: Sequence[tuple[str, str, AnyArray]],
    *,
    comment: str,
    binary: bool = True,
) -> None:
    """Write named columns as the vertices of a PLY file.

    Args:
        path: The file to make or replace.
        columns: Name, numpy type (`<f4`, `<f8` or `<u1`) and values, shape (N,), of every
            property; at least one.
        comment: What the header says of the file; one line of ascii.
        binary: Little-endian binary if true, else ascii.

    Raises:
        OSError: The file cannot be written.
    """
    rows = stack_columns(columns)
    header = [
        "ply",
        f"format {'binary_little_endian' if binary else 'ascii'} 1.0",
        f"comment {comment}",
        f"element vertex {len(rows)}",
        *(f"property {_PLY_TYPES[dtype[1:]]} {name}" for name, dtype, _ in columns),
        "end_header\n",
    ]

    def write(stream: BinaryIO) -> None:
        stream.write("\n".join(header).encode("ascii"))
        if binary:
            stream.write(rows.tobytes())
            return
        for start in range(0, len(rows), _CHUNK):
            # repr of a numpy scalar's item is the shortest text that reads back the same
            lines = [" ".join(map(str, row)) for row in rows[start : start + _CHUNK]]
            stream.write(("\n".join(lines) + "\n").encode("ascii"))

    write_atomic(path, write)


def stack_columns(columns: Sequence[tuple[str, str, AnyArray]]) -> npt.NDArray[np.void]:
    """Join columns to packed rows; shape (N,), one field per column."""
    dtype = [(name, dtype) for name, dtype, _ in columns]
    rows: npt.NDArray[np.void] = np.zeros(len(columns[0][2]), dtype=dtype)
    for name, _, values in columns:
        rows[name] = values
    return rows


def _checked(values: npt.ArrayLike, name: str, shape: tuple[int, ...]) -> AnyArray:
    """Check the shape of an argument."""
    array = np.asarray(values)
    if array.shape != shape:
        raise ShapeError(f"{name} must have shape {shape}, got {array.shape}")
    return array


def _checked_bytes(values: npt.ArrayLike, name: str, shape: tuple[int, ...]) -> AnyArray:
    """Check that an argument has a shape and fits in bytes."""
    array = _checked(values, name, shape)
    if array.dtype.kind not in "iu" or array.min() < 0 or array.max() > 255:
        raise ShapeError(f"{name} must be integers 0..255, got {array.dtype}")
    return array
