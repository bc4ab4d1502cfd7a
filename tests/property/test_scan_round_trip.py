"""Whatever an independent writer makes of a cloud, the reader gives the cloud back."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData, PlyElement
from pypcd4 import Encoding, PointCloud

from boltpose.io import read_scan
from boltpose.schema import Scan

FLOATS = st.sampled_from(["f4", "f8"])
ENCODINGS = [Encoding.ASCII, Encoding.BINARY, Encoding.BINARY_COMPRESSED]
INTS = st.sampled_from(["i1", "u1", "i2", "u2", "i4", "u4"])


@st.composite
def tables(draw: st.DrawFn) -> np.ndarray:
    """Named columns in any order and type: coordinates, and any of the optional groups."""
    count = draw(st.integers(3, 30))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    columns: dict[str, np.ndarray] = {}
    for name in "xyz":
        # float32-exact, so that every float type holds it
        values = rng.uniform(-500, 500, count).astype(np.float32)
        columns[name] = values.astype(draw(FLOATS))
    columns["x"][:2] = (-400, 400)
    if draw(st.booleans()):
        for name in ("nx", "ny", "nz"):
            columns[name] = rng.normal(size=count).astype(np.float32).astype(draw(FLOATS))
    if draw(st.booleans()):
        for name in ("red", "green", "blue"):
            columns[name] = rng.integers(0, 256, count).astype("u1")
    if draw(st.booleans()):
        columns["label"] = rng.integers(0, 7, count).astype(draw(INTS | FLOATS))
    for index in range(draw(st.integers(0, 3))):
        kind = draw(INTS | FLOATS)
        columns[f"extra_{index}"] = rng.integers(0, 100, count).astype(kind)
    names = draw(st.permutations(list(columns)))
    table = np.zeros(count, dtype=[(name, columns[name].dtype) for name in names])
    for name in names:
        table[name] = columns[name]
    return table


def assert_same(scan: Scan, table: np.ndarray) -> None:
    names = table.dtype.names or ()
    np.testing.assert_array_equal(scan.points, np.stack([table[name] for name in "xyz"], axis=1))
    for found, group in (
        (scan.normals, ("nx", "ny", "nz")),
        (scan.colors, ("red", "green", "blue")),
    ):
        if group[0] in names:
            np.testing.assert_array_equal(found, np.stack([table[n] for n in group], axis=1))
        else:
            assert found is None
    if "label" in names:
        np.testing.assert_array_equal(scan.labels, table["label"])
    else:
        assert scan.labels is None


@settings(max_examples=80, deadline=None)
@given(
    table=tables(),
    text=st.booleans(),
    byte_order=st.sampled_from("<>"),
    face_lengths=st.lists(st.integers(0, 6), max_size=5) | st.none(),
    faces_first=st.booleans(),
)
def test_ply(
    table: np.ndarray,
    text: bool,
    byte_order: str,
    face_lengths: list[int] | None,
    faces_first: bool,
) -> None:
    elements = [PlyElement.describe(table, "vertex")]
    if face_lengths is not None:
        faces = np.zeros(len(face_lengths), dtype=[("vertex_indices", object)])
        faces["vertex_indices"] = [np.arange(length, dtype=np.int32) for length in face_lengths]
        described = PlyElement.describe(
            faces, "face", val_types={"vertex_indices": "i4"}, len_types={"vertex_indices": "u1"}
        )
        elements.insert(0 if faces_first else 1, described)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.ply"
        PlyData(elements, text=text, byte_order=byte_order).write(path)
        assert_same(read_scan(path), table)


@settings(max_examples=80, deadline=None)
@given(table=tables(), encoding=st.sampled_from(ENCODINGS))
def test_pcd(table: np.ndarray, encoding: Encoding) -> None:
    names = table.dtype.names or ()
    renamed = {"nx": "normal_x", "ny": "normal_y", "nz": "normal_z"}
    types = [table.dtype[name].type for name in names]
    pcd = PointCloud.from_points(
        [table[name] for name in names], [renamed.get(name, name) for name in names], types
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.pcd"
        pcd.save(path, encoding=encoding)
        scan = read_scan(path)
    if encoding is Encoding.ASCII:  # ten digits after the point
        expected = np.stack([table[name] for name in "xyz"], axis=1)
        np.testing.assert_allclose(scan.points, expected, rtol=0, atol=1e-9)
    else:
        assert_same(scan, table)


@settings(max_examples=40, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 6), st.integers(3, 6)),
    dtype=st.sampled_from(["<f4", ">f4", "<f8", ">f8"]),
    seed=st.integers(0, 2**32 - 1),
    hole_share=st.floats(0, 0.5),
)
def test_npz_grids_with_holes(
    shape: tuple[int, int], dtype: str, seed: int, hole_share: float
) -> None:
    rng = np.random.default_rng(seed)
    grid = rng.uniform(-500, 500, (*shape, 3)).astype(dtype)
    is_hole = rng.random(shape) < hole_share
    is_hole[0, :3] = False
    grid[0, :2, 0] = (-400, 400)
    kinds = np.array([[np.nan] * 3, [0.0] * 3, [1.0, np.nan, 2.0], [np.inf, 1.0, 1.0]])
    grid[is_hole] = kinds[rng.integers(0, 4, int(is_hole.sum()))]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.npz"
        np.savez(path, points=grid)
        scan = read_scan(path)

    assert scan.grid_shape == shape
    assert scan.pixels is not None
    np.testing.assert_array_equal(scan.pixels, np.argwhere(~is_hole))
    np.testing.assert_array_equal(scan.points, grid[~is_hole])
