"""Damaged files end in one line about the file, or in data; never in another exception.

The examples are the same in every run: HDF5 is C code, and a crash found by chance in one run of
many would help nobody. A longer search (1500 damages per format) was made by hand.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import netCDF4
import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from pypcd4 import Encoding, PointCloud

from boltpose.errors import InputFileError
from boltpose.io import read_hand_eye, read_mesh, read_part_names, read_scan, write_ply

POINTS = np.random.default_rng(0).uniform(-200, 200, (48, 3)).astype(np.float32)
LABELS = np.arange(48) % 7
CAMERA = {"1": {"cam_K": [100.0, 0, 10, 0, 100, 10, 0, 0, 1], "depth_scale": 0.02}}


def save_ply(path: Path, *, binary: bool) -> None:
    write_ply(path, POINTS, labels=LABELS, colors=np.full((48, 3), 9), binary=binary)


def save_pcd(path: Path, encoding: Encoding) -> None:
    names = ("x", "y", "z")
    PointCloud.from_points(POINTS, names, (np.float32,) * 3).save(path, encoding=encoding)


def save_zdf(path: Path) -> None:
    with netCDF4.Dataset(path, "w") as file:
        group = file.createGroup("data")
        for name, size in (("rows", 6), ("cols", 8), ("xyz", 3)):
            group.createDimension(name, size)
        variable = group.createVariable("pointcloud", "f4", ("rows", "cols", "xyz"), zlib=True)
        variable[:] = POINTS.reshape(6, 8, 3)


def save_mesh(path: Path) -> None:
    box = trimesh.creation.box((100, 80, 60))
    if path.suffix == ".glb":
        box.apply_scale(0.001)
    data: Any = trimesh.Scene({"a": box}).export(file_type=path.suffix[1:])
    path.write_bytes(data if isinstance(data, bytes) else data.encode())


def save_hand_eye(path: Path) -> None:
    rows = "".join(f"  - {row}\n" for row in np.eye(4).tolist())
    path.write_text(f"FloatMatrix:\n Data:\n{rows}per_pose_residuals:\n - {{rotation_deg: 1}}\n")


SAVERS: dict[str, Callable[[Path], None]] = {
    "binary.ply": lambda path: save_ply(path, binary=True),
    "ascii.ply": lambda path: save_ply(path, binary=False),
    "ascii.pcd": lambda path: save_pcd(path, Encoding.ASCII),
    "binary.pcd": lambda path: save_pcd(path, Encoding.BINARY),
    "packed.pcd": lambda path: save_pcd(path, Encoding.BINARY_COMPRESSED),
    "plain.npz": lambda path: np.savez(path, points=POINTS, labels=LABELS),
    "packed.npz": lambda path: np.savez_compressed(path, points=POINTS, labels=LABELS),
    "netcdf.zdf": save_zdf,
    "000001.png": lambda path: Image.fromarray(
        np.arange(9000, 9600, dtype=np.uint16).reshape(20, 30)
    ).save(path),
    "box.stl": save_mesh,
    "box.obj": save_mesh,
    "box.glb": save_mesh,
    "hand_eye.yaml": save_hand_eye,
    "hand_eye.json": lambda path: path.write_text(json.dumps(np.eye(4).tolist())) and None,
    "names.yaml": lambda path: path.write_text("bolt_*: bolt\n'*': gear\n") and None,
}


def read(path: Path) -> Any:
    if path.suffix in (".stl", ".obj", ".glb"):
        return read_mesh(path)
    if path.name == "names.yaml":
        return read_part_names(path)
    if path.suffix in (".yaml", ".json"):
        return read_hand_eye(path)
    camera = path.parent / "camera.json"
    camera.write_text(json.dumps(CAMERA))
    return read_scan(path, camera=camera if path.suffix == ".png" else None)


@cache
def undamaged(name: str) -> bytes:
    with TemporaryDirectory() as folder:
        SAVERS[name](Path(folder) / name)
        return (Path(folder) / name).read_bytes()


@st.composite
def damages(draw: st.DrawFn, name: str) -> bytes:
    """The file cut off, with some bytes replaced, inserted or taken out."""
    data = bytearray(undamaged(name))
    # the first bytes say how the rest is read, so half of the damage goes there
    at = st.integers(0, len(data) - 1) | st.integers(0, min(400, len(data)) - 1)
    kind = draw(st.sampled_from(["cut", "insert", "remove", "replace", "replace", "replace"]))
    if kind == "cut":
        del data[draw(at) :]
    elif kind == "insert":
        start = draw(at)
        data[start:start] = draw(st.binary(min_size=1, max_size=20))
    elif kind == "remove":
        start = draw(at)
        del data[start : start + draw(st.integers(1, 20))]
    else:
        values = st.integers(0, 255) | st.sampled_from([0, 0x7F, 0xFF, 0x30, 0x39])
        for index, value in draw(st.lists(st.tuples(at, values), min_size=1, max_size=12)):
            data[index] = value
    return bytes(data)


@pytest.mark.parametrize("name", [name for name in SAVERS if name != "hand_eye.yaml"])
def test_undamaged_files_are_read(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(undamaged(name))
    assert read(tmp_path / name) is not None


@pytest.mark.parametrize("name", SAVERS)
@settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_damaged_files_are_read_or_refused_in_one_line(name: str, data: st.DataObject) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data.draw(damages(name)))
        text = f"{path}: found nothing wrong"
        try:
            read(path)
        except InputFileError as error:  # UnitError is one
            text = str(error)
    assert text.startswith(f"{path}: found ")
    assert "\n" not in text


@pytest.mark.parametrize("name", ["binary.ply", "binary.pcd", "packed.pcd", "plain.npz"])
def test_no_cut_of_a_binary_file_is_taken_for_the_whole(name: str, tmp_path: Path) -> None:
    whole = undamaged(name)
    for length in range(0, len(whole), 7):
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(InputFileError):
            read(tmp_path / name)
