"""What a codec hands to `read_scan`, and how named columns become it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from boltpose.arrays import AnyArray, BoolArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.schema import Part


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RawCloud:
    """A point cloud as its file holds it: holes still in, in the file's own unit."""

    points: AnyArray
    """Shape (N, 3), float32 or float64; NaN and (0, 0, 0) are holes."""
    colors: UInt8Array | None = None
    """Shape (N, 3), RGB."""
    normals: AnyArray | None = None
    """Shape (N, 3), float."""
    labels: AnyArray | None = None
    """Shape (N,), any real dtype, not yet checked."""
    classification: AnyArray | None = None
    """The same of a field `Classification`: CloudCompare paints labels into a field of that name,
    airborne scans keep classes of another kind there."""
    grid_shape: tuple[int, int] | None = None
    """Rows and columns, row-major, where the file is organised."""


def assemble_columns(
    path: Path, columns: Mapping[str, AnyArray], *, grid_shape: tuple[int, int] | None = None
) -> RawCloud:
    """Find points, colours, normals and labels among named columns.

    Args:
        path: The file, for the error text.
        columns: One array, shape (N,), per field of the file. Upper and lower case and
            CloudCompare's prefix `scalar_` make no difference; unknown names are ignored.
        grid_shape: Rows and columns of an organised file.

    Returns:
        The cloud.

    Raises:
        InputFileError: x, y or z is missing or the colours make no sense.
    """
    named = {name.lower().removeprefix("scalar_"): column for name, column in columns.items()}
    points = _stack(named, ("x", "y", "z"))
    if points is None:
        found = ", ".join(columns) or "none"
        raise InputFileError(path, f"the fields {found}", "x, y and z")
    colors = None
    for names in (
        ("red", "green", "blue"),
        ("r", "g", "b"),
        ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ):
        if colors is None and all(name in named for name in names):
            colors = np.stack([as_color_channel(named[name]) for name in names], axis=1)
    normals = _stack(named, ("nx", "ny", "nz"))
    if normals is None:
        normals = _stack(named, ("normal_x", "normal_y", "normal_z"))
    return RawCloud(
        points=points,
        colors=colors,
        normals=normals,
        labels=named.get("label"),
        classification=named.get("classification"),
        grid_shape=grid_shape,
    )


def read_table(lines: Iterator[str]) -> AnyArray:
    """Parse lines of numbers.

    Args:
        lines: Text lines, none blank, whitespace between the numbers.

    Returns:
        Shape (rows, columns), float64; (0, 0) when there is no line.

    Raises:
        ValueError: A word is no number or the lines differ in length.
    """
    first = next(lines, None)
    if first is None:  # numpy only warns
        return np.zeros((0, 0))
    return np.loadtxt(chain([first], lines), dtype=np.float64, comments=None, ndmin=2)


def typed_column(path: Path, name: str, values: AnyArray, dtype: str) -> AnyArray:
    """Give numbers read from text their declared type, so that they scale as in a binary file.

    Args:
        path: The file, for the error text.
        name: The field's name, for the error text.
        values: Shape (N,), float64.
        dtype: The declared numpy type; floats stay float64.

    Returns:
        Shape (N,).

    Raises:
        InputFileError: A number does not fit an integer type.
    """
    declared = np.dtype(dtype)
    if declared.kind == "f":
        return values
    limits = np.iinfo(declared)
    if not ((values >= limits.min) & (values <= limits.max)).all():
        found = f"a value of '{name}' that is no {declared.name}"
        raise InputFileError(path, found, f"{limits.min} to {limits.max}")
    return values.astype(declared)


def as_color_channel(values: AnyArray) -> UInt8Array:
    """Bring a colour channel of any type to 0..255.

    Args:
        values: uint8 is taken as it is, other integers are 0..255 if they fit and full range
            otherwise, floats are 0..1 if they fit and 0..255 otherwise; NaN becomes 0.

    Returns:
        Same shape, uint8.
    """
    if values.dtype == np.uint8:
        return values
    floats = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=255.0, neginf=0.0)
    largest = float(floats.max(initial=0.0))
    if values.dtype.kind == "f":
        factor = 255.0 if largest <= 1.0 else 1.0
    else:
        factor = 255.0 / np.iinfo(values.dtype).max if largest > 255.0 else 1.0
    return np.clip(np.rint(floats * factor), 0, 255).astype(np.uint8)


def are_labels(labels: AnyArray) -> BoolArray:
    """Tell which values are `Part` numbers; any real dtype, any shape."""
    good: BoolArray = (labels >= 0) & (labels <= max(Part))
    return good & (labels == np.floor(labels)) if labels.dtype.kind == "f" else good


def as_labels(path: Path, labels: AnyArray) -> UInt8Array:
    """Check that labels are `Part` numbers.

    Args:
        path: The file, for the error text.
        labels: Shape (N,), any real dtype.

    Returns:
        Shape (N,), uint8.

    Raises:
        InputFileError: A label is no whole number or no `Part`.
    """
    if labels.dtype.kind not in "fiu":
        raise InputFileError(path, f"labels of type {labels.dtype}", "integers")
    good = are_labels(labels)
    if not good.all():
        found = f"label {labels[~good][0]:g} on {(~good).sum()} of {len(labels)} points"
        wanted = ", ".join(f"{part.value} {part.name.lower()}" for part in Part)
        raise InputFileError(path, found, wanted)
    return labels.astype(np.uint8)


def _stack(columns: Mapping[str, AnyArray], names: tuple[str, str, str]) -> AnyArray | None:
    """Join three columns to shape (N, 3), or return None if one is missing."""
    if not all(name in columns for name in names):
        return None
    parts = [columns[name] for name in names]
    # float32 holds float32 and 16-bit integers exactly and halves the memory
    is_small = all(part.dtype.itemsize * (1 + (part.dtype.kind != "f")) <= 4 for part in parts)
    joined = np.zeros((len(parts[0]), 3), dtype=np.float32 if is_small else np.float64)
    for index, part in enumerate(parts):
        joined[:, index] = part
    return joined
