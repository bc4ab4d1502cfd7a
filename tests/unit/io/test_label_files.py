"""Labelled scans against independent readers and writers, and as CloudCompare writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plyfile import PlyData, PlyElement
from pypcd4 import PointCloud

from boltpose.errors import InputFileError, ShapeError, UnitError
from boltpose.io.label_files import LABEL_SUFFIXES, read_labelled_scan, write_labelled_scan
from boltpose.io.palette import colors_of_labels
from boltpose.io.scan import read_scan
from tests.unit.io.clouds import make_cloud

CLOUD = make_cloud(8, 10)
COUNT = len(CLOUD.points)
CONFIDENCE = np.random.default_rng(1).random(COUNT).astype(np.float32)


def foreign_ply(path: Path, points: np.ndarray = CLOUD.points, **fields: np.ndarray) -> Path:
    """A PLY file of another program."""
    columns = dict(zip("xyz", points.astype(np.float32).T, strict=True)) | fields
    rows = np.zeros(len(points), dtype=[(name, data.dtype) for name, data in columns.items()])
    for name, data in columns.items():
        rows[name] = data
    PlyData([PlyElement.describe(rows, "vertex")]).write(path)
    return path


def foreign_colors(colors: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(("red", "green", "blue"), colors.T, strict=True))


def write_all(path: Path, points: np.ndarray) -> None:
    write_labelled_scan(
        path,
        points,
        CLOUD.labels,
        colors=colors_of_labels(CLOUD.labels),
        normals=CLOUD.normals.astype(np.float32),
        scalars={"confidence": CONFIDENCE},
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_plyfile_finds_every_field_under_names_that_cloudcompare_loads(
    tmp_path: Path, dtype: type[np.floating[Any]]
) -> None:
    points = (CLOUD.points / 3).astype(dtype)
    write_all(tmp_path / "a.ply", points)

    vertex = PlyData.read(tmp_path / "a.ply")["vertex"].data

    assert vertex["x"].dtype == dtype
    np.testing.assert_array_equal(np.stack([vertex[n] for n in "xyz"], 1), points)
    np.testing.assert_array_equal(np.stack([vertex[f"n{n}"] for n in "xyz"], 1), CLOUD.normals)
    painted = np.stack([vertex[n] for n in ("red", "green", "blue")], 1)
    np.testing.assert_array_equal(painted, colors_of_labels(CLOUD.labels))
    assert vertex["scalar_Classification"].dtype == np.uint8
    np.testing.assert_array_equal(vertex["scalar_Classification"], CLOUD.labels)
    np.testing.assert_array_equal(vertex["scalar_confidence"], CONFIDENCE)
    # CloudCompare makes a scalar field of properties with `scal` in the name, shows the first
    known = {"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"}
    others = [name for name in vertex.dtype.names if name not in known]
    assert others[0] == "scalar_Classification"
    assert all("scal" in name for name in others)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_pypcd4_finds_every_field(tmp_path: Path, dtype: type[np.floating[Any]]) -> None:
    points = (CLOUD.points / 3).astype(dtype)
    write_all(tmp_path / "a.pcd", points)

    cloud = PointCloud.from_path(tmp_path / "a.pcd")

    np.testing.assert_array_equal(cloud.numpy(("x", "y", "z")).astype(dtype), points)
    np.testing.assert_array_equal(cloud.pc_data["label"], CLOUD.labels)
    np.testing.assert_array_equal(cloud.pc_data["confidence"], CONFIDENCE)
    np.testing.assert_array_equal(cloud.pc_data["normal_y"], CLOUD.normals[:, 1])
    packed = np.ascontiguousarray(cloud.pc_data["rgb"]).astype(np.float32)
    painted = PointCloud.decode_rgb(packed)
    np.testing.assert_array_equal(painted, colors_of_labels(CLOUD.labels))
    # PCL's PointXYZRGBL has `uint32 label`; CloudCompare reads no 8-bit field, shows the last one
    assert cloud.fields[-1] == "label"
    assert cloud.pc_data["label"].dtype == np.uint32


def test_an_organised_cloud_stays_organised_in_pcd(tmp_path: Path) -> None:
    points = CLOUD.points.astype(np.float32)
    points[3] = np.nan
    labels = CLOUD.labels.copy()
    write_labelled_scan(tmp_path / "a.pcd", points, labels, grid_shape=CLOUD.shape)
    scan = read_scan(tmp_path / "a.pcd")
    assert scan.grid_shape == CLOUD.shape
    np.testing.assert_array_equal(scan.labels, np.delete(labels, 3))


@pytest.mark.parametrize("suffix", LABEL_SUFFIXES)
@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("m", 1000.0), ("inch", 25.4)])
def test_what_was_written_is_read_back_in_mm_and_in_order(
    tmp_path: Path, suffix: str, unit: str, mm: float
) -> None:
    path = tmp_path / f"a{suffix}"
    write_labelled_scan(path, CLOUD.points / mm, CLOUD.labels, unit=unit)
    scan = read_labelled_scan(path, unit=unit)
    np.testing.assert_array_equal(scan.labels, CLOUD.labels)
    np.testing.assert_array_equal(scan.points, CLOUD.points / mm * mm)
    # and by whoever reads scans: `prior build --use-labels`
    np.testing.assert_array_equal(read_scan(path, unit=unit).labels, CLOUD.labels)
    assert f"boltpose, labelled, {unit}\n".encode() in path.read_bytes()


@pytest.mark.parametrize(
    "name", ["label", "scalar_label", "Classification", "scalar_Classification", "LABEL"]
)
@pytest.mark.parametrize("dtype", ["u1", "i4", "f4", "f8"])
def test_labels_under_every_name_and_type_cloudcompare_gives_them(
    tmp_path: Path, name: str, dtype: str
) -> None:
    path = foreign_ply(tmp_path / "a.ply", **{name: CLOUD.labels.astype(dtype)})
    np.testing.assert_array_equal(read_labelled_scan(path).labels, CLOUD.labels)


def test_two_fields_that_agree_are_one(tmp_path: Path) -> None:
    fields = {"scalar_label": CLOUD.labels.astype("f4"), "scalar_Classification": CLOUD.labels}
    path = foreign_ply(tmp_path / "a.ply", **fields)
    np.testing.assert_array_equal(read_labelled_scan(path).labels, CLOUD.labels)


def test_two_fields_that_differ_are_refused(tmp_path: Path) -> None:
    other = CLOUD.labels.copy()
    other[:4] = (other[:4] + 1) % 7
    path = foreign_ply(tmp_path / "a.ply", scalar_label=CLOUD.labels, scalar_Classification=other)
    with pytest.raises(InputFileError, match=r"differ on 4 points, wanted one of the two"):
        read_labelled_scan(path)


def test_a_field_goes_before_colours_unless_colours_are_asked_for(tmp_path: Path) -> None:
    painted = (CLOUD.labels + 1) % 7
    path = foreign_ply(
        tmp_path / "a.ply", label=CLOUD.labels, **foreign_colors(colors_of_labels(painted))
    )
    np.testing.assert_array_equal(read_labelled_scan(path).labels, CLOUD.labels)
    np.testing.assert_array_equal(read_labelled_scan(path, from_colors=True).labels, painted)


@pytest.mark.parametrize("off", [-2, 0, 2])
def test_colours_alone_will_do_also_rounded_and_as_floats(tmp_path: Path, off: int) -> None:
    rgb = np.clip(colors_of_labels(CLOUD.labels).astype(int) + off, 0, 255)
    path = foreign_ply(tmp_path / "a.ply", **foreign_colors(rgb.astype(np.uint8)))
    np.testing.assert_array_equal(read_labelled_scan(path).labels, CLOUD.labels)
    path = foreign_ply(tmp_path / "b.ply", **foreign_colors((rgb / 255).astype(np.float32)))
    np.testing.assert_array_equal(read_labelled_scan(path).labels, CLOUD.labels)


def test_colours_of_a_pcd_as_the_papers_group_writes_it(tmp_path: Path) -> None:
    packed = PointCloud.encode_rgb(colors_of_labels(CLOUD.labels))
    cloud = PointCloud.from_xyzrgb_points(
        np.column_stack([CLOUD.points.astype(np.float32), packed])
    )
    cloud.save(tmp_path / "a.pcd")
    np.testing.assert_array_equal(read_labelled_scan(tmp_path / "a.pcd").labels, CLOUD.labels)


def test_holes_need_no_label(tmp_path: Path) -> None:
    points, labels = CLOUD.points.copy(), CLOUD.labels.astype("f4")
    points[[0, 5]] = 0.0
    points[7] = np.nan
    labels[[0, 7]] = np.nan
    colors = colors_of_labels(CLOUD.labels)
    colors[[0, 5, 7]] = 200
    path = foreign_ply(tmp_path / "a.ply", points, label=labels, **foreign_colors(colors))
    kept = np.delete(CLOUD.labels, [0, 5, 7])
    for from_colors in (False, True):
        np.testing.assert_array_equal(
            read_labelled_scan(path, from_colors=from_colors).labels, kept
        )


@pytest.mark.parametrize(
    ("bad", "found"),
    [(np.nan, "nan"), (1.5, "1.5"), (7.0, "7"), (-1.0, "-1")],
    ids=["merged with a cloud that has no such field", "interpolated", "too large", "negative"],
)
def test_labels_that_are_none_are_refused_with_their_number(
    tmp_path: Path, bad: float, found: str
) -> None:
    labels = CLOUD.labels.astype("f4")
    labels[[3, 4]] = bad
    path = foreign_ply(tmp_path / "a.ply", scalar_Classification=labels)
    with pytest.raises(InputFileError, match=f"label {found} on 2 of {COUNT} points, wanted 0 "):
        read_labelled_scan(path)


def test_classes_of_another_kind_do_not_spoil_a_scan(tmp_path: Path) -> None:
    ground_and_trees = np.tile([2, 18], COUNT // 2).astype("u1")
    path = foreign_ply(tmp_path / "a.ply", Classification=ground_and_trees)
    assert read_scan(path).labels is None


def test_a_scan_without_labels_is_refused(tmp_path: Path) -> None:
    path = foreign_ply(tmp_path / "a.ply")
    with pytest.raises(InputFileError, match="found no labels, wanted a field `label`"):
        read_labelled_scan(path)
    with pytest.raises(InputFileError, match="found no colours"):
        read_labelled_scan(path, from_colors=True)


def test_a_wrong_unit_is_refused(tmp_path: Path) -> None:
    path = foreign_ply(tmp_path / "a.ply", CLOUD.points / 1000, label=CLOUD.labels)
    with pytest.raises(UnitError, match="looks like m"):
        read_labelled_scan(path)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("labels", CLOUD.labels[:-1]),
        ("colors", CLOUD.colors[:, :2]),
        ("normals", CLOUD.normals[:3]),
        ("scalars", {"confidence": CONFIDENCE[:2]}),
        ("points", CLOUD.points.astype(int)),
    ],
)
@pytest.mark.parametrize("suffix", LABEL_SUFFIXES)
def test_what_does_not_fit_is_not_written(
    tmp_path: Path, argument: str, value: Any, suffix: str
) -> None:
    arguments: dict[str, Any] = {"points": CLOUD.points, "labels": CLOUD.labels}
    arguments[argument] = value
    with pytest.raises(ShapeError):
        write_labelled_scan(tmp_path / f"a{suffix}", **arguments)
    assert list(tmp_path.iterdir()) == []


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"'\.las', wanted \.ply or \.pcd"):
        write_labelled_scan(tmp_path / "a.las", CLOUD.points, CLOUD.labels)


@pytest.mark.parametrize("suffix", LABEL_SUFFIXES)
def test_same_labels_same_bytes(tmp_path: Path, suffix: str) -> None:
    for name in ("a", "b"):
        write_all(tmp_path / f"{name}{suffix}", CLOUD.points)
    one, other = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("a", "b"))
    assert one == other
