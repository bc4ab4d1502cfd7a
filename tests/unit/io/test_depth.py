from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from boltpose.errors import InputFileError, UnitError
from boltpose.io import read_scan

REMAN18 = Path(__file__).parents[3] / "data" / "reman18"
CAMERA: dict[str, Any] = {
    "cam_K": [100.0, 0, 4.5, 0, 110.0, 2.25, 0, 0, 1],
    "depth_scale": 0.1,
}


def write_view(folder: Path, *, camera: Any = CAMERA, name: str = "000012.png") -> Path:
    (folder / "depth").mkdir()
    depth = np.full((6, 10), 6000, dtype=np.uint16)
    depth[2, 3] = 0
    depth[5, 9] = 65535
    Image.fromarray(depth).save(folder / "depth" / name)
    (folder / "scene_camera.json").write_text(json.dumps({"3": {}, "12": camera}))
    return folder / "depth" / name


def test_points_are_where_the_pinhole_camera_puts_them(tmp_path: Path) -> None:
    scan = read_scan(write_view(tmp_path))

    assert scan.grid_shape == (6, 10)
    assert scan.pixels is not None
    assert len(scan) == 59
    assert [2, 3] not in scan.pixels.tolist()
    expected_z = np.full(59, 600.0)
    expected_z[-1] = 6553.5
    np.testing.assert_allclose(scan.points[:, 2], expected_z, rtol=1e-12)
    # back through the camera: u = fx x / z + cx is the column, v the row
    columns = 100 * scan.points[:, 0] / scan.points[:, 2] + 4.5
    rows = 110 * scan.points[:, 1] / scan.points[:, 2] + 2.25
    np.testing.assert_allclose(np.stack([rows, columns], 1), scan.pixels, atol=1e-9)


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # load.py leaves closing to Python
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_equals_the_loader_of_the_simulated_reman18() -> None:
    spec = importlib.util.spec_from_file_location("reman18_load", REMAN18 / "load.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    view = module.Dataset(str(REMAN18)).view("motor_007", 2)

    scan = read_scan(REMAN18 / "motor_007" / "depth" / "000002.png")

    assert scan.pixels is not None
    np.testing.assert_array_equal(scan.pixels, np.argwhere(view["valid"]))
    np.testing.assert_array_equal(scan.points.astype(np.float32), view["xyz"][view["valid"]])


def test_camera_file_may_lie_elsewhere(tmp_path: Path) -> None:
    path = write_view(tmp_path)
    expected = read_scan(path).points
    moved = (tmp_path / "scene_camera.json").rename(tmp_path / "cameras.json")

    with pytest.raises(InputFileError, match=r"scene_camera\.json: found no such file"):
        read_scan(path)
    np.testing.assert_array_equal(read_scan(path, camera=moved).points, expected)


def test_depth_in_metres_is_noticed(tmp_path: Path) -> None:
    path = write_view(tmp_path, camera=CAMERA | {"depth_scale": 0.0001})
    with pytest.raises(UnitError, match="set --scan-unit m"):
        read_scan(path)
    assert read_scan(path, unit="m").points[0, 2] == pytest.approx(600)


@pytest.mark.parametrize(
    ("camera", "reason"),
    [
        ({}, "KeyError: 'cam_K'"),
        ("no camera", "TypeError"),
        ({"cam_K": [1, 2]}, "ValueError"),
        ({"cam_K": ["a"] * 9}, "ValueError"),
        (CAMERA | {"depth_scale": 0}, "focal lengths and depth_scale > 0"),
        (CAMERA | {"depth_scale": float("nan")}, "focal lengths and depth_scale > 0"),
        (CAMERA | {"cam_K": [0, 0, 4, 0, 1, 2, 0, 0, 1]}, "focal lengths and depth_scale > 0"),
        (CAMERA | {"cam_K": [100, 0, 0, 0, 100, 0, 4, 2, 1]}, "without skew"),
    ],
)
def test_bad_cameras_are_refused(tmp_path: Path, camera: Any, reason: str) -> None:
    path = write_view(tmp_path, camera=camera)
    with pytest.raises(InputFileError, match=rf"scene_camera\.json: found .*{reason}"):
        read_scan(path)


def test_image_without_entry_is_refused(tmp_path: Path) -> None:
    path = write_view(tmp_path, name="000013.png")
    with pytest.raises(InputFileError, match=r"no entry '13' for 000013\.png among 2"):
        read_scan(path)


@pytest.mark.parametrize("mode", ["L", "RGB", "1", "P"])
def test_other_images_are_refused(tmp_path: Path, mode: str) -> None:
    path = write_view(tmp_path)
    Image.new(mode, (10, 6)).save(path)
    with pytest.raises(InputFileError, match="wanted a 16-bit greyscale PNG"):
        read_scan(path)


def test_an_image_that_claims_to_be_huge_is_refused_unread(tmp_path: Path) -> None:
    path = write_view(tmp_path)
    data = bytearray(path.read_bytes())
    data[16:24] = (200_000).to_bytes(4, "big") * 2
    path.write_bytes(data)
    with pytest.raises(InputFileError, match="200000 x 200000 pixels"):
        read_scan(path)


def test_a_renamed_file_is_refused(tmp_path: Path) -> None:
    path = write_view(tmp_path)
    path.write_bytes(b"ply\n" * 30)
    with pytest.raises(InputFileError, match="found no PNG"):
        read_scan(path)
