"""Read a scan from any supported file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from boltpose.arrays import AnyArray, BoolArray, FloatArray, IntArray, UInt8Array
from boltpose.errors import InputFileError
from boltpose.io.depth import read_depth
from boltpose.io.guard import MAX_POINTS, refusing, require_file
from boltpose.io.npz import read_npz
from boltpose.io.pcd import read_pcd
from boltpose.io.ply import read_ply
from boltpose.io.raw import RawCloud, as_labels
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
    file = Path(path)
    length_unit = as_unit(unit)
    suffix = file.suffix.lower()
    wanted = f"a scan, one of {', '.join(SCAN_SUFFIXES)}"
    if suffix in _MESH_SUFFIXES:
        wanted += " (meshes are read by `boltpose prior build`)"
    require_file(file, wanted)
    if suffix not in SCAN_SUFFIXES:
        raise InputFileError(file, f"the suffix '{file.suffix}'", wanted)
    if camera is not None and suffix != ".png":
        raise InputFileError(file, f"a camera file for a {suffix} scan", "one for .png only")
    camera_file = None if camera is None else Path(camera)
    raw = read_depth(file, camera=camera_file) if suffix == ".png" else _READERS[suffix](file)
    with refusing(file, wanted):
        return _clean(file, raw, length_unit)


def _clean(path: Path, raw: RawCloud, unit: Unit) -> Scan:
    """Drop the holes, check the size and scale to mm."""
    count = len(raw.points)
    if count > MAX_POINTS:
        raise InputFileError(path, f"{count} points", f"at most {MAX_POINTS}")
    is_valid = _all_in_row(np.isfinite(raw.points)) & ~_all_in_row(raw.points == 0)
    _check_count(path, is_valid)
    check_extent(path, robust_extent(raw.points[is_valid]), unit, option="--scan-unit")
    with np.errstate(invalid="ignore"):  # NaN is compared too
        is_valid &= _all_in_row(np.abs(raw.points) <= MAX_COORDINATE_MM / unit.mm)
    _check_count(path, is_valid)
    points: FloatArray = _pick(raw.points, is_valid).astype(np.float64)
    points *= unit.mm
    pixels: IntArray | None = None
    if raw.grid_shape is not None:
        pixels = np.argwhere(is_valid.reshape(raw.grid_shape)).astype(np.int64)
    labels: UInt8Array | None = None
    if raw.labels is not None:
        labels = as_labels(path, _pick(raw.labels, is_valid))
    normals: FloatArray | None = None
    if raw.normals is not None:
        normals = _pick(raw.normals, is_valid).astype(np.float64)
        normals[~np.isfinite(normals).all(axis=1)] = 0.0
    return Scan(
        points=points,
        colors=None if raw.colors is None else _pick(raw.colors, is_valid),
        normals=normals,
        labels=labels,
        pixels=pixels,
        grid_shape=raw.grid_shape,
        source=str(path),
    )


def _all_in_row(mask: BoolArray) -> BoolArray:
    """Tell which rows of a mask, shape (N, 3), are true throughout; faster than `all(axis=1)`."""
    return mask[:, 0] & mask[:, 1] & mask[:, 2]


def _pick(array: AnyArray, mask: BoolArray) -> AnyArray:
    """Select rows, without a copy when all are wanted."""
    return array if mask.all() else array[mask]


def _check_count(path: Path, is_valid: BoolArray) -> None:
    """Refuse clouds with next to nothing in them."""
    count = int(is_valid.sum())
    if count < _MIN_POINTS:
        found = f"{count} valid of {len(is_valid)} points"
        raise InputFileError(path, found, f"at least {_MIN_POINTS}")
