from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import netCDF4
import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.io import read_scan
from tests.unit.io.clouds import make_cloud

CLOUD = make_cloud()
GRID = CLOUD.points.reshape(*CLOUD.shape, 3).astype(np.float32)


def write_zdf(path: Path, *, compressed: bool, with_colors: bool = True) -> np.ndarray:
    grid = GRID.copy()
    grid[0, 3] = np.nan
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        group = file.createGroup("data")
        for name, size in (("rows", 5), ("cols", 8), ("xyz", 3), ("rgba", 4)):
            group.createDimension(name, size)
        shape = ("rows", "cols")
        group.createVariable("pointcloud", "f4", (*shape, "xyz"), zlib=compressed)[:] = grid
        group.createVariable("contrast", "f4", shape, zlib=compressed)[:] = 1.0
        if with_colors:
            rgba = np.dstack([CLOUD.colors.reshape(*CLOUD.shape, 3), np.full(CLOUD.shape, 255)])
            group.createVariable("rgba_image", "u1", (*shape, "rgba"))[:] = rgba
    return grid


@pytest.mark.parametrize("compressed", [False, True])
def test_reads_what_netcdf_wrote(tmp_path: Path, compressed: bool) -> None:
    grid = write_zdf(tmp_path / "a.zdf", compressed=compressed)

    scan = read_scan(tmp_path / "a.zdf")

    assert scan.grid_shape == (5, 8)
    assert scan.pixels is not None
    assert len(scan) == 39
    rows, columns = scan.pixels.T
    np.testing.assert_array_equal(scan.points, grid[rows, columns])
    np.testing.assert_array_equal(scan.colors, CLOUD.colors.reshape(5, 8, 3)[rows, columns])


def test_colours_are_optional(tmp_path: Path) -> None:
    write_zdf(tmp_path / "a.zdf", compressed=False, with_colors=False)
    assert read_scan(tmp_path / "a.zdf").colors is None


@pytest.mark.parametrize(
    ("entries", "reason"),
    [
        ({"frame/points": GRID}, "the HDF5 entries frame, .*export PLY or PCD from Zivid Studio"),
        ({"data/pointcloud/x": GRID}, "the HDF5 entries data, .*export PLY or PCD"),
        ({"data/pointcloud": GRID[0]}, r"shape \(8, 3\).*export PLY or PCD"),
        ({"data/pointcloud": GRID.astype(np.int32)}, "type int32"),
        ({"data/pointcloud": GRID, "data/rgba_image": GRID}, r"rgba_image of shape \(5, 8, 3\)"),
    ],
)
def test_unknown_layouts_say_how_to_convert(
    tmp_path: Path, entries: dict[str, Any], reason: str
) -> None:
    with h5py.File(tmp_path / "a.zdf", "w") as file:
        for name, array in entries.items():
            file[name] = array
    with pytest.raises(InputFileError, match=reason):
        read_scan(tmp_path / "a.zdf")


def test_a_data_set_that_claims_to_be_huge_is_refused_unread(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.zdf", "w") as file:
        file.create_dataset("data/pointcloud", (10**6, 10**6, 3), "f4", chunks=(64, 64, 3))
    with pytest.raises(InputFileError, match="claims 3000000000000 values"):
        read_scan(tmp_path / "a.zdf")


def test_a_file_that_is_no_hdf5_says_how_to_convert(tmp_path: Path) -> None:
    (tmp_path / "a.zdf").write_bytes(b"ZDF2 something newer" * 100)
    with pytest.raises(InputFileError, match=r"OSError.*export PLY or PCD from Zivid Studio"):
        read_scan(tmp_path / "a.zdf")
