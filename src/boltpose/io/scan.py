"""Read a scan from any supported file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from boltpose.arrays import AnyArray, BoolArray, FloatArray, IntArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.io.depth import read_depth
from boltpose.io.guard import MAX_POINTS, refusing, require_file
from boltpose.io.npz import read_npz
from boltpose.io.pcd import read_pcd
from boltpose.io.ply import read_ply
from boltpose.io.raw import RawCloud, are_labels, as_labels
from boltpose.io.units import Unit, as_unit, check_extent, robust_extent
from boltpose.io.zdf import read_zdf
from boltpose.schema import Scan

MAX_COORDINATE_MM = 1e6
"""Points a kilometre away are an invalid mark (1e10, the largest float) or a damaged value."""

_MIN_POINTS = 3
_MESH_SUFFIXES = (".stl", ".obj", ".glb")
_READERS: dict[str, Callable[[Path], RawCloud]] = {
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".zdf": read_zdf,
    ".npz": read_npz,
}
SCAN_SUFFIXES = (*_READERS, ".png")
"""Suffixes that `read_scan` knows."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RawScan:
    """All rows of a scan's file, and which of them are points."""

    path: Path
    raw: RawCloud
    unit: Unit
    is_valid: BoolArray
    """Shape (N,); False for holes."""

    @property
    def points_mm(self) -> FloatArray:
        """Shape (M, 3), mm, the valid points in their order."""
        points: FloatArray = pick_rows(self.raw.points, self.is_valid).astype(np.float64)
        points *= self.unit.mm
        return points


def read_scan(path: str | Path, *, unit: str = Unit.MM, camera: str | Path | None = None) -> Scan:
    """Read a point cloud; the suffix tells the format.

    NaN, infinite and (0, 0, 0) points are holes and are left out. See docs/formats.md for the
    fields of every format.

    Args:
        path: A `.ply`, `.pcd`, `.zdf`, `.npz` or 16-bit depth `.png` file.
        unit: The unit of length in the file, a `Unit`.
        camera: `scene_camera.json` of a depth image, where it is not beside the image's folder.

    Returns:
        The scan in mm, in the file's own frame, with `pixels` and `grid_shape` where the file is
        organised. Normals that are not finite are (0, 0, 0).

    Raises:
        ConfigError: There is no such unit.
        InputFileError: The file is missing, of another kind, broken, or holds fewer than three
            valid points.
        UnitError: The size of the data does not fit the unit.
    """
    every = read_raw_scan(path, unit=unit, camera=camera)
    with refusing(every.path, _wanted(every.path.suffix.lower())):
        return _as_scan(every)


def read_raw_scan(
    path: str | Path, *, unit: str = Unit.MM, camera: str | Path | None = None
) -> RawScan:
    """Read a scan with its holes, for who writes it again row by row.

    Args:
        path: As for `read_scan`.
        unit: As for `read_scan`.
        camera: As for `read_scan`.

    Returns:
        The rows as the file has them, in the file's unit.

    Raises:
        ConfigError: There is no such unit.
        InputFileError: As for `read_scan`.
        UnitError: The size of the data does not fit the unit.
    """
    file = Path(path)
    length_unit = as_unit(unit)
    suffix = file.suffix.lower()
    wanted = _wanted(suffix)
    require_file(file, wanted)
    if suffix not in SCAN_SUFFIXES:
        raise InputFileError(file, f"the suffix '{file.suffix}'", wanted)
    if camera is not None and suffix != ".png":
        raise InputFileError(file, f"a camera file for a {suffix} scan", "one for .png only")
    camera_file = None if camera is None else Path(camera)
    raw = read_depth(file, camera=camera_file) if suffix == ".png" else _READERS[suffix](file)
    with refusing(file, wanted):
        return RawScan(
            path=file, raw=raw, unit=length_unit, is_valid=_find_points(file, raw, length_unit)
        )


def _wanted(suffix: str) -> str:
    """Say what can be read, to who came with a file of that suffix."""
    wanted = f"a scan, one of {', '.join(SCAN_SUFFIXES)}"
    if suffix in _MESH_SUFFIXES:
        wanted += " (meshes are read by `boltpose prior build`)"
    return wanted


def _find_points(path: Path, raw: RawCloud, unit: Unit) -> BoolArray:
    """Tell points from holes and check the size."""
    count = len(raw.points)
    if count > MAX_POINTS:
        raise InputFileError(path, f"{count} points", f"at most {MAX_POINTS}")
    is_valid = _all_in_row(np.isfinite(raw.points)) & ~_all_in_row(raw.points == 0)
    _check_count(path, is_valid)
    check_extent(path, robust_extent(raw.points[is_valid]), unit, option="--scan-unit")
    with np.errstate(invalid="ignore"):  # NaN is compared too
        is_valid &= _all_in_row(np.abs(raw.points) <= MAX_COORDINATE_MM / unit.mm)
    _check_count(path, is_valid)
    return is_valid


def _as_scan(every: RawScan) -> Scan:
    """Drop the holes and scale to mm."""
    raw, is_valid = every.raw, every.is_valid
    pixels: IntArray | None = None
    if raw.grid_shape is not None:
        pixels = np.argwhere(is_valid.reshape(raw.grid_shape)).astype(np.int64)
    labels: UInt8Array | None = None
    if raw.labels is not None:
        labels = as_labels(every.path, pick_rows(raw.labels, is_valid))
    elif raw.classification is not None:
        classes = pick_rows(raw.classification, is_valid)
        labels = as_labels(every.path, classes) if are_labels(classes).all() else None
    normals: FloatArray | None = None
    if raw.normals is not None:
        normals = pick_rows(raw.normals, is_valid).astype(np.float64)
        normals[~np.isfinite(normals).all(axis=1)] = 0.0
    return Scan(
        points=every.points_mm,
        colors=None if raw.colors is None else pick_rows(raw.colors, is_valid),
        normals=normals,
        labels=labels,
        pixels=pixels,
        grid_shape=raw.grid_shape,
        source=str(every.path),
    )


def _all_in_row(mask: BoolArray) -> BoolArray:
    """Tell which rows of a mask, shape (N, 3), are true throughout; faster than `all(axis=1)`."""
    return mask[:, 0] & mask[:, 1] & mask[:, 2]


def pick_rows(array: AnyArray, mask: BoolArray) -> AnyArray:
    """Select rows, without a copy when all are wanted."""
    return array if mask.all() else array[mask]


def _check_count(path: Path, is_valid: BoolArray) -> None:
    """Refuse clouds with next to nothing in them."""
    count = int(is_valid.sum())
    if count < _MIN_POINTS:
        found = f"{count} valid of {len(is_valid)} points"
        raise InputFileError(path, found, f"at least {_MIN_POINTS}")
