from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plyfile import PlyData

from boltpose.errors import ShapeError
from boltpose.io import read_scan, write_ply
from tests.unit.io.clouds import make_cloud

CLOUD = make_cloud()


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_independent_reader_finds_every_field(
    tmp_path: Path, binary: bool, dtype: type[np.floating[Any]]
) -> None:
    points = (CLOUD.points / 3).astype(dtype)
    write_ply(
        tmp_path / "a.ply",
        points,
        labels=CLOUD.labels,
        colors=CLOUD.colors,
        normals=CLOUD.normals,
        binary=binary,
    )

    data = PlyData.read(tmp_path / "a.ply")
    vertex = data["vertex"].data

    assert data.text is not binary
    assert vertex["x"].dtype == dtype
    np.testing.assert_array_equal(np.stack([vertex[n] for n in "xyz"], 1), points)
    normals = np.stack([vertex[n] for n in ("nx", "ny", "nz")], 1)
    np.testing.assert_array_equal(normals, CLOUD.normals)
    colors = np.stack([vertex[n] for n in ("red", "green", "blue")], 1)
    np.testing.assert_array_equal(colors, CLOUD.colors)
    np.testing.assert_array_equal(vertex["label"], CLOUD.labels)


@pytest.mark.parametrize("binary", [True, False])
def test_our_reader_gives_back_the_same_bits(tmp_path: Path, binary: bool) -> None:
    write_ply(tmp_path / "a.ply", CLOUD.points / 3, labels=CLOUD.labels, binary=binary)
    scan = read_scan(tmp_path / "a.ply")
    np.testing.assert_array_equal(scan.points, CLOUD.points / 3)
    np.testing.assert_array_equal(scan.labels, CLOUD.labels)
    assert scan.colors is None
    assert scan.normals is None


def test_same_cloud_same_bytes(tmp_path: Path) -> None:
    for name in ("a.ply", "b.ply"):
        write_ply(tmp_path / name, CLOUD.points, colors=CLOUD.colors)
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


@pytest.mark.parametrize(
    "fields",
    [
        {"labels": CLOUD.labels[:-1]},
        {"labels": CLOUD.labels.astype(float)},
        {"labels": CLOUD.labels.astype(int) - 1},
        {"labels": CLOUD.labels.astype(int) + 250},
        {"colors": CLOUD.colors / 255},
        {"colors": CLOUD.colors[:, :2]},
        {"normals": CLOUD.normals[:3]},
    ],
)
def test_fields_that_do_not_fit_are_refused_and_nothing_is_written(
    tmp_path: Path, fields: dict[str, Any]
) -> None:
    with pytest.raises(ShapeError, match=next(iter(fields))):
        write_ply(tmp_path / "a.ply", CLOUD.points, **fields)
    assert list(tmp_path.iterdir()) == []


def test_points_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="points must be finite"):
        write_ply(tmp_path / "a.ply", [[0, 0, np.nan]])
