"""Scans in numpy archives; nothing is ever unpickled."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from boltpose.arrays import AnyArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.io.guard import MAX_POINTS, refusing
from boltpose.io.raw import RawCloud, as_color_channel

_WANTED = "an NPZ file with an array `points` or `xyz` of shape (N, 3) or (H, W, 3), not pickled"
_MAX_BYTES = MAX_POINTS * 24
_POINT_KEYS = ("points", "xyz")


def read_npz(path: Path) -> RawCloud:
    """Read a numpy archive.

    Args:
        path: The file. Arrays read: `points` or `xyz`, (N, 3) or (H, W, 3), any real type;
            `colors` and `normals` of the same shape; `labels`, (N,) or (H, W). Others are
            skipped unread.

    Returns:
        The cloud, in the file's unit.

    Raises:
        InputFileError: It is no NPZ, broken, pickled, or the shapes do not belong together.
    """
    with refusing(path, _WANTED):
        if not zipfile.is_zipfile(path):
            raise InputFileError(path, "no zip archive", _WANTED)
        refuse_huge_arrays(path)
        with np.load(path, allow_pickle=False) as arrays:
            keys = [key for key in _POINT_KEYS if key in arrays.files]
            if len(keys) != 1:
                found = f"the arrays {', '.join(arrays.files)[:120] or 'none'}"
                raise InputFileError(path, found, _WANTED)
            points = _checked(path, keys[0], arrays[keys[0]])
            grid = points.shape[:-1]
            if points.ndim not in (2, 3) or points.shape[-1] != 3:
                raise InputFileError(path, f"`{keys[0]}` of shape {points.shape}", _WANTED)
            optional: dict[str, AnyArray] = {}
            for key, shape in (("colors", (*grid, 3)), ("normals", (*grid, 3)), ("labels", grid)):
                if key in arrays.files:
                    array = _checked(path, key, arrays[key])
                    if array.shape != shape:
                        found = f"`{key}` of shape {array.shape}"
                        raise InputFileError(path, found, f"{shape}, as the points")
                    optional[key] = array.reshape(-1, *shape[len(grid) :])
        return RawCloud(
            # half and integer types would overflow in what follows
            points=points.reshape(-1, 3).astype(
                np.float32 if points.dtype == np.float32 else np.float64, copy=False
            ),
            colors=_as_colors(optional.get("colors")),
            normals=optional.get("normals"),
            labels=optional.get("labels"),
            grid_shape=(grid[0], grid[1]) if len(grid) == 2 else None,
        )


def refuse_huge_arrays(path: Path) -> None:
    """Refuse a numpy archive that would unpack to more than any scan needs (a zip bomb).

    The sizes are those of the archive's directory; zipfile unpacks no more than they say.

    Raises:
        InputFileError: An array is larger than `MAX_POINTS` points of three float64.
        zipfile.BadZipFile: It is no archive, or a broken one.
    """
    with zipfile.ZipFile(path) as archive:
        largest = max((info.file_size for info in archive.infolist()), default=0)
    if largest > _MAX_BYTES:
        raise InputFileError(path, "an array above 1.2 GB", f"at most {MAX_POINTS} points")


def _checked(path: Path, key: str, array: AnyArray) -> AnyArray:
    """Refuse arrays that do not hold real numbers."""
    if array.dtype.kind not in "fiu":
        raise InputFileError(path, f"`{key}` of type {array.dtype}", "real numbers")
    return array


def _as_colors(colors: AnyArray | None) -> UInt8Array | None:
    """Bring colours of any type to 0..255."""
    return None if colors is None else as_color_channel(colors)
