"""Scans in Zivid's ZDF files, as SDK 1.x wrote them."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from boltpose.arrays import AnyArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.io.guard import MAX_POINTS, refusing
from boltpose.io.raw import RawCloud

_WANTED = (
    "a Zivid ZDF file with data/pointcloud of shape (H, W, 3); "
    "for other versions export PLY or PCD from Zivid Studio"
)


def read_zdf(path: Path) -> RawCloud:
    """Read a ZDF file, which is netCDF-4, which is HDF5.

    Args:
        path: The file. Group `data`: `pointcloud`, (H, W, 3), float, mm in the camera's optical
            frame, NaN where invalid; `rgba_image`, (H, W, 4), uint8, optional.

    Returns:
        The organised cloud.

    Raises:
        InputFileError: It is no HDF5, broken or of an unknown layout.
    """
    with refusing(path, _WANTED), h5py.File(path, "r") as file:
        points = _read_array(file, "data/pointcloud")
        if points is None:
            found = f"the HDF5 entries {', '.join(sorted(file))[:120] or 'none'}"
            raise InputFileError(path, found, _WANTED)
        if points.ndim != 3 or points.shape[2] != 3 or points.dtype.kind != "f":
            found = f"data/pointcloud of shape {points.shape} and type {points.dtype}"
            raise InputFileError(path, found, _WANTED)
        rows, columns, _ = points.shape
        rgba = _read_array(file, "data/rgba_image")
        colors: UInt8Array | None = None
        if rgba is not None:
            if rgba.shape != (rows, columns, 4) or rgba.dtype != np.uint8:
                found = f"data/rgba_image of shape {rgba.shape} and type {rgba.dtype}"
                raise InputFileError(path, found, f"({rows}, {columns}, 4), uint8")
            colors = rgba.reshape(-1, 4)[:, :3]
        return RawCloud(
            points=points.reshape(-1, 3), colors=colors, grid_shape=(int(rows), int(columns))
        )


def _read_array(file: h5py.File, name: str) -> AnyArray | None:
    """Read a data set whole, or return None if the file has none of that name."""
    entry = file.get(name)
    if not isinstance(entry, h5py.Dataset):
        return None
    if entry.size is None or entry.size > MAX_POINTS * 4:
        raise ValueError(f"{name} claims {entry.size} values")
    return np.asarray(entry[()])
