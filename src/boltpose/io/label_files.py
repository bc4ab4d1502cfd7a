"""Scans with a class per point, as people correct them in CloudCompare: read and written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from boltpose.arrays import AnyArray, UInt8Array
from boltpose.errors import InputFileError, ShapeError
from boltpose.io.labelled import write_ply_columns
from boltpose.io.palette import labels_of_colors
from boltpose.io.pcd_write import packed_rgb, write_pcd_columns
from boltpose.io.raw import as_labels
from boltpose.io.scan import RawScan, pick_rows, read_raw_scan
from boltpose.io.units import Unit
from boltpose.schema import Scan

LABEL_SUFFIXES = (".ply", ".pcd")
"""Formats that carry labels and that CloudCompare reads and writes."""

PLY_LABEL = "scalar_Classification"
"""CloudCompare takes properties with `scal` in their name for scalar fields without being asked,
shows the first of them, and its Segment tool paints classes into the field `Classification`
(since its version 2.12)."""
PCD_LABEL = "label"
"""The name of PCL's point types with labels. 32 bits: CloudCompare reads no 8-bit fields here."""

_PLY_RGB = ("red", "green", "blue")
_WANTED = "a field `label` or `Classification`, or the colours of the palette"


def read_labelled_scan(path: str | Path, *, unit: str = Unit.MM, from_colors: bool = False) -> Scan:
    """Read a scan whose points carry classes.

    Labels come from a field `label` or `Classification` (of any number type, in any case, with or
    without CloudCompare's prefix `scalar_`); from the palette's colours where there is no field.

    Args:
        path: A `.ply`, `.pcd` or `.npz` file.
        unit: The unit of length in the file, a `Unit`.
        from_colors: Take the colours though there is a field: after editing colours.

    Returns:
        The scan in mm; `labels` is not None.

    Raises:
        InputFileError: As for `read_scan`; or there are no labels, they are no `Part` numbers, two
            fields contradict each other, or a colour is not in the palette.
        ConfigError: There is no such unit.
        UnitError: The size of the data does not fit the unit.
    """
    every = read_raw_scan(path, unit=unit)
    labels = labels_of_rows(every, from_colors=from_colors)[every.is_valid]
    raw = every.raw
    return Scan(
        points=every.points_mm,
        colors=None if raw.colors is None else pick_rows(raw.colors, every.is_valid),
        labels=labels,
        source=str(every.path),
    )


def labels_of_rows(every: RawScan, *, from_colors: bool = False) -> UInt8Array:
    """Find the label of every row of a file; shape (N,), 0 for holes.

    Args:
        every: The file.
        from_colors: Take the colours though there is a field.

    Raises:
        InputFileError: As for `read_labelled_scan`.
    """
    raw, path, is_valid = every.raw, every.path, every.is_valid
    labels = np.zeros(len(is_valid), dtype=np.uint8)
    if from_colors:
        if raw.colors is None:
            raise InputFileError(path, "no colours", "the colours of the palette")
        labels[is_valid] = labels_of_colors(path, raw.colors[is_valid])
        return labels
    present = (raw.labels, raw.classification)
    fields = [field[is_valid] for field in present if field is not None]
    differ = int((fields[0] != fields[1]).sum()) if len(fields) == 2 else 0
    if differ:
        found = f"fields `label` and `Classification` that differ on {differ} points"
        raise InputFileError(path, found, "one of the two: delete the other")
    if fields:
        labels[is_valid] = as_labels(path, fields[0])
        return labels
    if raw.colors is None:
        raise InputFileError(path, "no labels", _WANTED)
    labels[is_valid] = labels_of_colors(path, raw.colors[is_valid])
    return labels


def write_labelled_scan(
    path: str | Path,
    points: npt.ArrayLike,
    labels: UInt8Array,
    *,
    unit: str = Unit.MM,
    colors: npt.ArrayLike | None = None,
    normals: npt.ArrayLike | None = None,
    scalars: Mapping[str, npt.ArrayLike] | None = None,
    grid_shape: tuple[int, int] | None = None,
) -> None:
    """Write a scan whose points carry classes, so that CloudCompare shows and paints them.

    PLY: `x y z`, `nx ny nz`, `red green blue`, `uchar scalar_Classification`, `scalar_*`.
    PCD: `x y z`, `normal_x normal_y normal_z`, `rgb`, scalars, `label`.

    Args:
        path: A `.ply` or `.pcd` file, to make or replace.
        points: Shape (N, 3), float32 or float64, written as they are; holes may be among them.
        labels: Shape (N,), `Part` numbers.
        unit: Unit of the points; noted in the file, nothing is scaled.
        colors: Shape (N, 3), RGB 0..255.
        normals: Shape (N, 3), float.
        scalars: Further fields by name, shape (N,), written as float32.
        grid_shape: Rows and columns of an organised cloud; PLY has no place for it.

    Raises:
        ShapeError: Shapes do not belong together.
        InputFileError: The suffix is another one.
        OSError: The file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in LABEL_SUFFIXES:
        raise InputFileError(path, f"the suffix '{suffix}'", " or ".join(LABEL_SUFFIXES))
    xyz = np.asarray(points)
    if xyz.ndim != 2 or xyz.shape[1] != 3 or xyz.dtype.kind != "f":
        raise ShapeError(f"points must be floats of shape (N, 3), got {xyz.dtype} {xyz.shape}")
    count = len(xyz)
    is_ply = suffix == ".ply"
    columns = _vectors(("x", "y", "z"), xyz, xyz.dtype)
    if normals is not None:
        names = ("nx", "ny", "nz") if is_ply else ("normal_x", "normal_y", "normal_z")
        vectors = _sized(normals, "normals", (count, 3))
        columns += _vectors(names, vectors, vectors.dtype)
    rgb = None if colors is None else _sized(colors, "colors", (count, 3)).astype(np.uint8)
    numbers = _sized(labels, "labels", (count,))
    fields = [
        (name, "<f4", _sized(values, name, (count,))) for name, values in (scalars or {}).items()
    ]
    comment = f"boltpose, labelled, {Unit(unit)}"
    if is_ply:
        if rgb is not None:
            columns += [(name, "<u1", rgb[:, i]) for i, name in enumerate(_PLY_RGB)]
        columns.append((PLY_LABEL, "<u1", numbers))
        columns += [(f"scalar_{name}", dtype, values) for name, dtype, values in fields]
        write_ply_columns(path, columns, comment=comment)
        return
    if rgb is not None:
        columns.append(("rgb", "<f4", packed_rgb(rgb)))
    # CloudCompare shows the last field of a PCD file, and the first of a PLY file
    columns += [*fields, (PCD_LABEL, "<u4", numbers)]
    write_pcd_columns(path, columns, comment=comment, grid_shape=grid_shape)


def _vectors(
    names: tuple[str, str, str], values: AnyArray, dtype: np.dtype[Any]
) -> list[tuple[str, str, AnyArray]]:
    """Make three columns of shape (N,) from vectors of shape (N, 3), in single if they are."""
    real = "<f4" if dtype == np.float32 else "<f8"
    return [(name, real, values[:, i]) for i, name in enumerate(names)]


def _sized(values: npt.ArrayLike, name: str, shape: tuple[int, ...]) -> AnyArray:
    """Check the shape of an argument."""
    array = np.asarray(values)
    if array.shape != shape:
        raise ShapeError(f"{name} must have shape {shape}, got {array.shape}")
    return array
