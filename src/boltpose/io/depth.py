"""Scans as 16-bit depth images with a camera file, in the form of the BOP benchmark."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from PIL import Image

from boltpose.arrays import FloatArray
from boltpose.errors import InputFileError
from boltpose.io.guard import MAX_POINTS, refusing, require_file
from boltpose.io.raw import RawCloud

_WANTED = "a 16-bit greyscale PNG with depth along the optical axis"
_WANTED_CAMERA = "a JSON object {image id: {cam_K: [9 numbers], depth_scale: number > 0}}"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_MAX_CAMERA_BYTES = 20_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class _Camera:
    """A pinhole camera; pixel centres have whole coordinates."""

    fx: float
    fy: float
    cx: float
    cy: float
    depth_scale: float
    """File units per step of the image."""


def read_depth(path: Path, *, camera: Path | None = None) -> RawCloud:
    """Read a depth image as an organised cloud.

    Args:
        path: The image; 0 means no measurement. Its stem is the image id, `000012.png` is 12.
        camera: `scene_camera.json`; by default the one in the parent of the image's folder.

    Returns:
        The cloud in frame `camera` (+z forward, +x right, +y down), in the unit of
        value * depth_scale, which is mm by BOP's definition.

    Raises:
        InputFileError: The image or the camera file is missing, broken or of another kind, or
            has no entry for the image.

    Source:
        BOP format, `docs/bop_datasets_format.md` of bop_toolkit.
    """
    with refusing(path, _WANTED):
        _check_png(path)
        with Image.open(path, formats=["PNG"]) as image:
            depth = np.asarray(image)
        if depth.ndim != 2 or depth.dtype.kind not in "iu":
            raise InputFileError(path, f"shape {depth.shape}, type {depth.dtype}", _WANTED)
    camera_path = path.parent.parent / "scene_camera.json" if camera is None else camera
    pinhole = _read_camera(require_file(camera_path, _WANTED_CAMERA), path)
    return RawCloud(
        points=_unproject(depth.astype(np.float64), pinhole),
        grid_shape=(depth.shape[0], depth.shape[1]),
    )


def _check_png(path: Path) -> None:
    """Check kind and size in the first bytes, before anything is decoded."""
    with path.open("rb") as stream:
        start = stream.read(26)
    if len(start) < 26 or not start.startswith(_PNG_START):
        raise InputFileError(path, "no PNG", _WANTED)
    width, height, bits, color_type = struct.unpack(">IIBB", start[16:26])
    if width * height > MAX_POINTS:
        raise InputFileError(path, f"{width} x {height} pixels", f"at most {MAX_POINTS}")
    if (bits, color_type) != (16, 0):
        found = f"a PNG of {bits} bits per channel and colour type {color_type}"
        raise InputFileError(path, found, _WANTED)


def _read_camera(path: Path, image: Path) -> _Camera:
    """Find the image's entry in a camera file."""
    with refusing(path, _WANTED_CAMERA):
        if path.stat().st_size > _MAX_CAMERA_BYTES:
            raise InputFileError(path, "more than 20 MB", _WANTED_CAMERA)
        entries: Any = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(entries, dict):
            raise InputFileError(path, "no JSON object", _WANTED_CAMERA)
        by_id = cast(dict[str, Any], entries)
        key = str(int(image.stem)) if image.stem.isdecimal() else image.stem
        if key not in by_id:
            found = f"no entry '{key}' for {image.name} among {len(by_id)}"
            raise InputFileError(path, found, _WANTED_CAMERA)
        matrix = np.array(by_id[key]["cam_K"], dtype=np.float64).reshape(3, 3)
        scale = float(by_id[key].get("depth_scale", 1.0))
        fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
        others = matrix[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]]
        if not (np.isfinite(matrix).all() and fx > 0 and fy > 0 and 0 < scale < np.inf):
            found = f"cam_K {matrix.ravel().tolist()} and depth_scale {scale}"
            raise InputFileError(path, found, "focal lengths and depth_scale > 0")
        if others.tolist() != [0, 0, 0, 0, 1]:
            found = f"cam_K {matrix.ravel().tolist()}"
            raise InputFileError(path, found, "[fx, 0, cx, 0, fy, cy, 0, 0, 1], without skew")
        return _Camera(fx=fx, fy=fy, cx=cx, cy=cy, depth_scale=scale)


def _unproject(depth: FloatArray, camera: _Camera) -> FloatArray:
    """Turn an image, shape (H, W), into points, shape (H W, 3); holes become (0, 0, 0)."""
    rows, columns = depth.shape
    z = depth * camera.depth_scale
    points = np.zeros((rows, columns, 3))
    points[..., 0] = (np.arange(columns) - camera.cx) / camera.fx * z
    points[..., 1] = (np.arange(rows)[:, None] - camera.cy) / camera.fy * z
    points[..., 2] = z
    return points.reshape(-1, 3)
