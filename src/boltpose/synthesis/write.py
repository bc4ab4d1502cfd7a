"""Samples as bytes, and bytes as folders that appear whole or not at all."""

from __future__ import annotations

import io
import json
import os
import secrets
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from boltpose.arrays import AnyArray, FloatArray, UInt8Array
from boltpose.errors import ShapeError

_MARK = ".part"
"""Ending of folders that are being written; they also start with a dot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleFile:
    """One file of a sample."""

    name: str
    """Path below the sample's folder, with `/`."""
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One motor of a data set, ready to be written."""

    name: str
    """Name of its folder."""
    files: tuple[SampleFile, ...]
    seconds: tuple[tuple[str, float], ...] = ()
    """Processor time by stage; shown, never written, so that bytes do not depend on the machine."""
    retries: tuple[str, ...] = ()
    """Draws that could not be built, and why; written in the sample too."""


def sample_name(number: int) -> str:
    """Folder of a sample: `motor_00012`."""
    return f"motor_{number:05d}"


def write_sample(root: Path, sample: Sample) -> None:
    """Write a sample under a temporary name, then rename it as a whole.

    A sample that is there already is kept: it has the same bytes.

    Args:
        root: The data set's folder, which must exist.
        sample: What to write.

    Raises:
        OSError: The disk is full, or the folder not writable; nothing half-written stays.
    """
    target = root / sample.name
    temporary = root / f".{sample.name}.{os.getpid()}-{secrets.token_hex(4)}{_MARK}"
    try:
        for file in sample.files:
            path = temporary / file.name
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as stream:
                stream.write(file.data)
                stream.flush()
                os.fsync(stream.fileno())
        if not target.exists():
            temporary.rename(target)
    finally:
        if temporary.exists():
            shutil.rmtree(temporary)


def finished_samples(root: Path) -> frozenset[str]:
    """Names of the samples that are whole."""
    return frozenset(path.name for path in root.glob("motor_*") if path.is_dir())


def remove_unfinished(root: Path) -> None:
    """Remove what a run that was killed left half-written."""
    for path in root.glob(f".motor_*{_MARK}"):
        shutil.rmtree(path)


def json_bytes(document: Any) -> bytes:
    """JSON in the form of reman18: one space per level, no trailing newline."""
    return json.dumps(document, indent=1, allow_nan=False).encode()


def rounded(values: Any, decimals: int = 6) -> Any:
    """Numbers for JSON, in nested lists, without the -0.0 that rounding leaves.

    Args:
        values: A number, or an array of any shape.
        decimals: Digits behind the point.

    Returns:
        A float, or lists of floats.
    """
    array = np.round(np.asarray(values, dtype=np.float64), decimals) + 0.0
    return array.tolist()


def ply_bytes(points: FloatArray, labels: UInt8Array) -> bytes:
    """A labelled cloud as binary little endian PLY: float x, y, z and uchar label.

    Args:
        points: Shape (N, 3), mm.
        labels: Shape (N,).

    Raises:
        ShapeError: The two differ in length.
    """
    if len(points) != len(labels):
        raise ShapeError(f"labels must have {len(points)} rows, got {len(labels)}")
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nproperty uchar label\nend_header\n"
    )
    row = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "u1")])
    table = np.zeros(len(points), dtype=row)
    for column, axis in enumerate("xyz"):
        table[axis] = points[:, column]
    table["label"] = labels
    return header.encode("ascii") + table.tobytes()


def depth_png_bytes(depth_mm: FloatArray, depth_scale_mm: float) -> bytes:
    """A depth image as 16-bit PNG.

    Args:
        depth_mm: Shape (H, W), along the optical axis; 0 where nothing was measured.
        depth_scale_mm: mm per step.

    Raises:
        ShapeError: A depth does not fit into 16 bits.
    """
    steps = np.round(depth_mm / depth_scale_mm)
    if steps.min() < 0 or steps.max() > np.iinfo(np.uint16).max:
        farthest = np.iinfo(np.uint16).max * depth_scale_mm
        raise ShapeError(f"depth must be 0 to {farthest:.0f} mm, got up to {depth_mm.max():.0f}")
    return _png(steps.astype(np.uint16))


def label_png_bytes(labels: UInt8Array) -> bytes:
    """Classes of pixels, shape (H, W), as 8-bit PNG."""
    return _png(labels)


def hand_eye_bytes(matrix: FloatArray) -> bytes:
    """`base_from_camera`, shape (4, 4), mm, as the YAML of a Zivid hand-eye calibration."""
    rows = ",\n".join(
        "      [" + ", ".join(f"{value + 0.0:.9g}" for value in row) + "]" for row in matrix
    )
    text = (
        "__version__:\n  serializer: 1\n  data: 1\n"
        "# camera frame B -> robot base frame A, millimetres\n"
        f"FloatMatrix:\n  Data:\n    [\n{rows}\n    ]\n"
    )
    return text.encode()


def _png(image: AnyArray) -> bytes:
    stream = io.BytesIO()
    # 6, the default, takes four times as long for depth noise and saves one percent
    Image.fromarray(image).save(stream, format="PNG", compress_level=4)
    return stream.getvalue()
