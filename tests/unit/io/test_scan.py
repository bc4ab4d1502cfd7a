from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import ConfigError, InputFileError, UnitError
from boltpose.io import SCAN_SUFFIXES, read_scan, write_ply
from tests.unit.io.clouds import make_cloud

CLOUD = make_cloud()


@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("m", 1000.0), ("cm", 10.0), ("inch", 25.4)])
def test_every_unit_comes_out_in_mm(tmp_path: Path, unit: str, mm: float) -> None:
    write_ply(tmp_path / "a.ply", CLOUD.points / mm)
    scan = read_scan(tmp_path / "a.ply", unit=unit)
    np.testing.assert_allclose(scan.points, CLOUD.points, rtol=1e-15)


def test_metres_are_refused_by_name_with_the_option_and_never_scaled(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", CLOUD.points / 1000)
    with pytest.raises(
        UnitError,
        match=r"a\.ply: found an extent of 0\.3\d+ mm \(looks like m: set --scan-unit m\)",
    ):
        read_scan(tmp_path / "a.ply")


def test_millimetres_said_to_be_metres_are_refused(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", CLOUD.points)
    with pytest.raises(UnitError, match="looks like mm: set --scan-unit mm"):
        read_scan(tmp_path / "a.ply", unit="m")


def test_unknown_unit_is_a_config_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="unknown unit 'feet'"):
        read_scan(tmp_path / "a.ply", unit="feet")


def test_holes_go_and_everything_else_stays_in_step(tmp_path: Path) -> None:
    cloud = make_cloud(20, 30)
    points = cloud.points.copy()
    points[3] = np.nan
    points[4, 1] = np.inf
    points[7] = 0
    points[9, 0] = 1e30
    points[11] = (0, 0, 500)
    np.savez(
        tmp_path / "a.npz",
        points=points,
        colors=cloud.colors,
        normals=cloud.normals,
        labels=cloud.labels,
    )

    scan = read_scan(tmp_path / "a.npz")

    kept = [i for i in range(600) if i not in (3, 4, 7, 9)]
    np.testing.assert_array_equal(scan.points, points[kept])
    np.testing.assert_array_equal(scan.colors, cloud.colors[kept])
    np.testing.assert_array_equal(scan.normals, cloud.normals[kept])
    np.testing.assert_array_equal(scan.labels, cloud.labels[kept])


def test_three_valid_points_are_enough_and_two_are_not(tmp_path: Path) -> None:
    points = np.full((10, 3), np.nan)
    points[2:5] = np.diag([100.0, 200.0, 300.0])
    np.savez(tmp_path / "a.npz", points=points)
    assert len(read_scan(tmp_path / "a.npz")) == 3

    points[2] = 0
    np.savez(tmp_path / "a.npz", points=points)
    with pytest.raises(InputFileError, match="2 valid of 10 points, wanted at least 3"):
        read_scan(tmp_path / "a.npz")


@pytest.mark.parametrize("suffix", SCAN_SUFFIXES)
def test_missing_folder_and_empty_are_named(tmp_path: Path, suffix: str) -> None:
    missing, folder, empty = (tmp_path / f"{name}{suffix}" for name in ("no", "folder", "empty"))
    folder.mkdir()
    empty.touch()

    for path, found in ((missing, "no such file"), (folder, "a folder"), (empty, "an empty file")):
        with pytest.raises(InputFileError) as caught:
            read_scan(path)
        assert str(caught.value).startswith(f"{path}: found {found}, wanted a scan, one of .ply")


@pytest.mark.parametrize("suffix", SCAN_SUFFIXES)
def test_another_kind_of_file_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"%PDF-1.7\n" + bytes(range(256)) * 10)
    with pytest.raises(InputFileError, match=r": found .*, wanted .*"):
        read_scan(path)


def test_unknown_suffix_lists_what_there_is(tmp_path: Path) -> None:
    (tmp_path / "a.las").write_bytes(b"LASF")
    with pytest.raises(
        InputFileError, match=r"the suffix '\.las', wanted .*\.ply, \.pcd, \.zdf, \.npz, \.png"
    ):
        read_scan(tmp_path / "a.las")


def test_a_mesh_is_sent_to_the_right_command(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"solid")
    with pytest.raises(InputFileError, match="boltpose prior build"):
        read_scan(tmp_path / "a.stl")


def test_a_camera_for_a_cloud_is_refused(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", CLOUD.points)
    with pytest.raises(InputFileError, match=r"a camera file for a \.ply scan"):
        read_scan(tmp_path / "a.ply", camera=tmp_path / "scene_camera.json")


def test_arrays_of_a_scan_cannot_be_written(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", CLOUD.points, labels=CLOUD.labels)
    scan = read_scan(tmp_path / "a.ply")
    with pytest.raises(ValueError, match="read-only"):
        scan.points[0] = 0
