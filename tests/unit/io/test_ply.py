from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from boltpose.errors import InputFileError
from boltpose.io import read_scan
from tests.unit.io.clouds import Cloud, make_cloud

FORMATS = [(True, "="), (False, "<"), (False, ">")]
XYZ = [("x", "f4"), ("y", "f4"), ("z", "f4")]


def rows(cloud: Cloud, fields: list[tuple[str, str]]) -> np.ndarray:
    columns = {
        **{name: cloud.points[:, i] for i, name in enumerate("xyz")},
        **{name: cloud.normals[:, i] for i, name in enumerate(("nx", "ny", "nz"))},
        **{name: cloud.colors[:, i] for i, name in enumerate(("red", "green", "blue"))},
        "label": cloud.labels,
    }
    table = np.zeros(len(cloud.points), dtype=fields)
    for name, _ in fields:
        table[name] = columns.get(name, 7)
    return table


def save(path: Path, text: bool, byte_order: str, *elements: PlyElement) -> Path:
    PlyData(list(elements), text=text, byte_order=byte_order).write(path)
    return path


def faces(*lengths: int) -> PlyElement:
    table = np.zeros(len(lengths), dtype=[("vertex_indices", object), ("flags", "u1")])
    for row, length in zip(table, lengths, strict=True):
        row["vertex_indices"] = np.arange(length, dtype=np.int32)
    return PlyElement.describe(
        table, "face", val_types={"vertex_indices": "i4"}, len_types={"vertex_indices": "u1"}
    )


@pytest.mark.parametrize(("text", "byte_order"), FORMATS)
def test_all_attributes_in_an_odd_order_and_type(
    tmp_path: Path, text: bool, byte_order: str
) -> None:
    cloud = make_cloud()
    fields = [
        ("blue", "u1"), ("z", "f8"), ("quality", "i2"), ("nx", "f4"), ("x", "f4"), ("label", "i4"),
        ("ny", "f8"), ("red", "u1"), ("nz", "f4"), ("y", "f8"), ("green", "u1"),
    ]  # fmt: skip
    element = PlyElement.describe(rows(cloud, fields), "vertex")

    scan = read_scan(save(tmp_path / "a.ply", text, byte_order, element))

    # plyfile writes ascii floats with 18 digits
    np.testing.assert_array_equal(scan.points, cloud.points)
    np.testing.assert_array_equal(scan.normals, cloud.normals)
    np.testing.assert_array_equal(scan.colors, cloud.colors)
    np.testing.assert_array_equal(scan.labels, cloud.labels)
    assert scan.points.dtype == np.float64
    assert scan.labels is not None
    assert scan.labels.dtype == np.uint8
    assert scan.source == str(tmp_path / "a.ply")
    assert scan.pixels is None


@pytest.mark.parametrize(("text", "byte_order"), FORMATS)
@pytest.mark.parametrize("lengths", [(), (3,), (3, 3, 3), (3, 4, 0, 5)])
@pytest.mark.parametrize("is_first", [False, True])
def test_faces_are_skipped_wherever_they_stand(
    tmp_path: Path, text: bool, byte_order: str, lengths: tuple[int, ...], is_first: bool
) -> None:
    cloud = make_cloud()
    elements = [PlyElement.describe(rows(cloud, XYZ), "vertex"), faces(*lengths)]
    if is_first:
        elements.reverse()

    scan = read_scan(save(tmp_path / "a.ply", text, byte_order, *elements))

    np.testing.assert_array_equal(scan.points, cloud.points)


def header(*lines: str, kind: str = "ascii", eol: str = "\n") -> bytes:
    return eol.join(["ply", f"format {kind} 1.0", *lines, "end_header", ""]).encode()


VERTEX = ("element vertex 4", "property float x", "property float y", "property float z")
BODY = b"0 0 100\n100 0 0\n0 100 0\n100 100 nan\n"


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("lengths", [[2] * 40, [*range(40)]])
def test_lists_among_the_vertex_properties_are_skipped(
    tmp_path: Path, kind: str, lengths: list[int]
) -> None:
    # by hand: plyfile 1.1.5 forgets the byte order of plain properties beside lists
    cloud = make_cloud()
    order = ">" if kind == "binary_big_endian" else "<"
    body = b""
    for point, length in zip(cloud.points, lengths, strict=True):
        near = range(length)
        if kind == "ascii":
            words = [repr(float(point[0])), length, *near, *map(float, point[1:])]
            body += " ".join(map(str, words)).encode() + b"\n"
        else:
            body += struct.pack(f"{order}fH{length}iff", point[0], length, *near, *point[1:])
    path = tmp_path / "a.ply"
    lines = ["element vertex 40", VERTEX[1], "property list ushort int near", *VERTEX[2:]]
    path.write_bytes(header(*lines, kind=kind) + body)

    np.testing.assert_array_equal(read_scan(path).points, cloud.points)


@pytest.mark.parametrize("eol", ["\n", "\r\n"])
def test_hand_written_file_with_comments_blank_lines_and_both_line_ends(
    tmp_path: Path, eol: str
) -> None:
    path = tmp_path / "a.PLY"
    text = header("comment made by hand, in mm", *VERTEX, "obj_info x", eol=eol)
    path.write_bytes(text + eol.encode() + BODY.replace(b"\n", eol.encode()))

    assert read_scan(path).points.tolist() == [[0, 0, 100], [100, 0, 0], [0, 100, 0]]


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("uchar", (0, 128, 255), (0, 128, 255)),
        ("float", (0.0, 0.5, 1.0), (0, 128, 255)),
        ("float", (0.0, 128.0, 255.0), (0, 128, 255)),
        ("ushort", (0, 32896, 65535), (0, 128, 255)),
        ("int", (0, 128, 255), (0, 128, 255)),
    ],
)
@pytest.mark.parametrize("names", [("red", "green", "blue"), ("r", "g", "b")])
def test_colours_of_any_type_become_bytes(
    tmp_path: Path,
    kind: str,
    values: tuple[float, ...],
    expected: tuple[int, ...],
    names: tuple[str, ...],
) -> None:
    path = tmp_path / "a.ply"
    colors = [f"property {kind} {name}" for name in names]
    lines = BODY.decode().splitlines()
    body = "\n".join(f"{line} {' '.join(map(str, values))}" for line in lines)
    path.write_bytes(header(*VERTEX, *colors) + body.encode())

    scan = read_scan(path)

    assert scan.colors is not None
    assert scan.colors.tolist() == [list(expected)] * 3


def test_cloudcompare_labels_are_found(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    body = b"0 0 100 6\n100 0 0 0\n0 100 0 1\n100 100 nan 99\n"
    path.write_bytes(header(*VERTEX, "property float scalar_Label") + body)

    labels = read_scan(path).labels

    assert labels is not None
    assert labels.tolist() == [6, 0, 1]  # the label of a hole does not matter


@pytest.mark.parametrize("label", ["7", "-1", "2.5", "nan"])
def test_labels_that_are_no_classes_are_refused(tmp_path: Path, label: str) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(
        header(*VERTEX, "property float label")
        + f"0 0 100 0\n100 0 0 {label}\n0 100 0 1\n100 100 0 1\n".encode()
    )
    with pytest.raises(InputFileError, match=r"label .*wanted 0 background, .*, 6 bolt"):
        read_scan(path)


def test_normals_that_are_not_finite_become_zero(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    names = [f"property float n{axis}" for axis in "xyz"]
    body = b"0 0 100 0 0 1\n100 0 0 nan nan nan\n0 100 0 1 0 0\n100 100 nan 1 0 0\n"
    path.write_bytes(header(*VERTEX, *names) + body)

    normals = read_scan(path).normals

    assert normals is not None
    assert normals.tolist() == [[0, 0, 1], [0, 0, 0], [1, 0, 0]]


def binary(*lines: str, body: bytes) -> bytes:
    return header(*lines, kind="binary_little_endian") + body


XYZ_BYTES = np.array([[0, 0, 100], [100, 0, 0], [0, 100, 0], [1, 2, 3]], "<f4").tobytes()
LIST = ("element face 1", "property list char int vertex_indices")
BROKEN: dict[str, tuple[bytes, str]] = {
    "no ply": (b"solid x\n" * 9, "no 'ply'"),
    "only ply": (b"ply\n", "without 'end_header'"),
    "no format": (b"ply\nelement vertex 3\nend_header\n", "without a format line"),
    "unknown format": (header(*VERTEX, kind="binary"), "header line 'format binary 1.0'"),
    "no vertex": (header("element face 0"), "0 elements 'vertex'"),
    "two vertex": (header(*VERTEX, *VERTEX) + BODY * 2, "2 elements 'vertex'"),
    "no z": (header(*VERTEX[:3]) + b"1 2\n" * 4, "the fields x, y, wanted x, y and z"),
    "no properties": (header("element vertex 4"), "rows of 'vertex'|the fields none"),
    "x twice": (header(*VERTEX, VERTEX[1]), "property 'x' twice"),
    "unknown type": (header(*VERTEX, "property half w"), "property 'half w'"),
    "float list length": (header(*VERTEX, "property list float int i"), "list length of type"),
    "property first": (header("property float x"), "header line 'property float x'"),
    "negative count": (header("element vertex -4"), "header line"),
    "absurd count": (header("element vertex 99999999999", *VERTEX[1:]), "at most 50000000"),
    "no points": (header("element vertex 0", *VERTEX[1:]), "0 valid of 0 points|the fields none"),
    "ascii short": (header(*VERTEX) + BODY[:16], "rows of 'vertex', wanted 4"),
    "ascii nothing": (header(*VERTEX), "0 rows of 'vertex', wanted 4"),
    "ascii long": (header(*VERTEX) + BODY * 2, "more rows than the header says"),
    "ascii wide": (header(*VERTEX) + b"1 2 3 4\n" * 4, "4 values in a vertex row"),
    "ascii ragged": (header(*VERTEX) + b"1 2 3\n1 2\n1 2 3\n1 2 3\n", "ValueError"),
    "ascii words": (header(*VERTEX) + b"1 2 3\n1 2 x\n1 2 3\n1 2 3\n", "ValueError"),
    "ascii huge uchar": (
        header(*VERTEX, "property uchar red") + b"1 2 3 256\n" * 4,
        "a value of 'red' that is no uint8",
    ),
    "ascii face missing": (header(*VERTEX, *LIST) + BODY, "0 rows of 'face', wanted 1"),
    "binary short": (binary(*VERTEX, body=XYZ_BYTES[:-1]), "ends within element 'vertex'"),
    "binary long": (binary(*VERTEX, body=XYZ_BYTES * 2), "48 bytes more than the header"),
    "binary face missing": (binary(*VERTEX, *LIST, body=XYZ_BYTES), "within element 'face'"),
    "binary face short": (
        binary(*VERTEX, *LIST, body=XYZ_BYTES + b"\x03\0\0\0"),
        "a list of length 3",
    ),
    "binary face negative": (
        binary(*VERTEX, *LIST, body=XYZ_BYTES + b"\xff" + bytes(8)),
        "a list of length -1",
    ),
    "binary later face negative": (
        binary(*VERTEX, "element face 2", LIST[1], body=XYZ_BYTES + b"\x01abcd\xff" + bytes(8)),
        "a list of length -1",
    ),
    "two points": (
        header("element vertex 3", *VERTEX[1:]) + b"1 2 300\n0 0 0\n1 2 3\n",
        "2 valid of 3 points, wanted at least 3",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    content, reason = BROKEN[case]
    path = tmp_path / "bad.ply"
    path.write_bytes(content)

    with pytest.raises(InputFileError, match=reason) as caught:
        read_scan(path)

    assert str(caught.value).startswith(f"{path}: found ")
    assert "\n" not in str(caught.value)


def test_binary_may_end_with_blanks(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(binary(*VERTEX, body=XYZ_BYTES + b"\n"))
    assert len(read_scan(path)) == 4
