"""Write point clouds as PCD."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.arrays import AnyArray, Float32Array, UInt8Array
from boltpose.io.atomic import write_atomic
from boltpose.io.labelled import stack_columns

_PCD_TYPES = {"f": "F", "u": "U"}


def write_pcd_columns(
    path: str | Path,
    columns: Sequence[tuple[str, str, AnyArray]],
    *,
    comment: str,
    grid_shape: tuple[int, int] | None = None,
) -> None:
    """Write named columns as a binary PCD file.

    Args:
        path: The file to make or replace.
        columns: Name, numpy type (`<f4`, `<f8`, `<u1`, `<u4`) and values, shape (N,), of every
            field; at least one.
        comment: What the header says of the file; one line of ascii.
        grid_shape: Rows and columns of an organised cloud, row-major; their product is N.

    Raises:
        OSError: The file cannot be written.

    Source:
        The PCD file format, version 0.7, documentation of the Point Cloud Library.
    """
    rows = stack_columns(columns)
    height, width = (1, len(rows)) if grid_shape is None else grid_shape
    types = [np.dtype(dtype) for _, dtype, _ in columns]
    header = [
        f"# {comment}",
        "VERSION 0.7",
        f"FIELDS {' '.join(name for name, _, _ in columns)}",
        f"SIZE {' '.join(str(dtype.itemsize) for dtype in types)}",
        f"TYPE {' '.join(_PCD_TYPES[dtype.kind] for dtype in types)}",
        f"COUNT {' '.join('1' for _ in types)}",
        f"WIDTH {width}",
        f"HEIGHT {height}",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {width * height}",
        "DATA binary\n",
    ]

    def write(stream: BinaryIO) -> None:
        stream.write("\n".join(header).encode("ascii"))
        stream.write(rows.tobytes())

    write_atomic(path, write)


def packed_rgb(colors: UInt8Array) -> Float32Array:
    """Pack colours, shape (N, 3), the way PCL stores them: 0x00RRGGBB as the bits of a float."""
    channels = colors.astype(np.uint32)
    return ((channels[:, 0] << 16) | (channels[:, 1] << 8) | channels[:, 2]).view(np.float32)
