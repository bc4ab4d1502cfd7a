from __future__ import annotations

import struct
from pathlib import Path

import lzf
import numpy as np
import pytest
from pypcd4 import Encoding, PointCloud

from boltpose.errors import InputFileError
from boltpose.io import read_scan
from tests.unit.io.clouds import Cloud, make_cloud

ENCODINGS = [Encoding.ASCII, Encoding.BINARY, Encoding.BINARY_COMPRESSED]


def packed_rgb(cloud: Cloud) -> np.ndarray:
    red, green, blue = cloud.colors.astype(np.uint32).T
    return (red << 16) | (green << 8) | blue


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_all_attributes_in_an_odd_order(tmp_path: Path, encoding: Encoding) -> None:
    cloud = make_cloud()
    x, y, z = cloud.points.T
    nx, ny, nz = cloud.normals.T
    names = ("normal_z", "y", "rgb", "x", "curvature", "label", "z", "normal_x", "normal_y")
    columns = [nz, y, packed_rgb(cloud), x, x * 0, cloud.labels, z, nx, ny]
    types = [np.float32, np.float64, np.uint32, np.float32, np.float32, np.uint8, np.float64]
    types += [np.float32, np.float32]
    pcd = PointCloud.from_points(
        [np.asarray(c, dtype=t) for c, t in zip(columns, types, strict=True)], names, types
    )
    pcd.save(tmp_path / "a.pcd", encoding=encoding)

    scan = read_scan(tmp_path / "a.pcd")

    # pypcd4 writes ascii floats with 10 digits after the point
    atol = 1e-7 if encoding is Encoding.ASCII else 0
    np.testing.assert_allclose(scan.points, cloud.points, rtol=0, atol=atol)
    np.testing.assert_allclose(scan.normals, cloud.normals, rtol=0, atol=atol)
    np.testing.assert_array_equal(scan.colors, cloud.colors)
    np.testing.assert_array_equal(scan.labels, cloud.labels)
    assert scan.pixels is None


def pcd_text(
    *,
    fields: str = "x y z",
    size: str = "4 4 4",
    kind: str = "F F F",
    count: str | None = "1 1 1",
    width: str = "4",
    height: str = "1",
    points: str | None = "4",
    data: str = "ascii",
    eol: str = "\n",
) -> bytes:
    lines = ["# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7"]
    lines += [f"FIELDS {fields}", f"SIZE {size}", f"TYPE {kind}"]
    lines += [] if count is None else [f"COUNT {count}"]
    lines += [f"WIDTH {width}", f"HEIGHT {height}", "VIEWPOINT 1 2 3 1 0 0 0"]
    lines += [] if points is None else [f"POINTS {points}"]
    return eol.join([*lines, f"DATA {data}", ""]).encode()


BODY = b"0 0 100\n100 0 0\nnan nan nan\n0 100 0\n"
POINTS = [[0, 0, 100], [100, 0, 0], [0, 100, 0]]


@pytest.mark.parametrize("eol", ["\n", "\r\n"])
def test_hand_written_file_without_optional_lines(tmp_path: Path, eol: str) -> None:
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_text(count=None, points=None, eol=eol) + BODY)
    assert read_scan(path).points.tolist() == POINTS


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_organised_files_keep_their_grid(tmp_path: Path, data: str) -> None:
    path = tmp_path / "a.pcd"
    rows = np.array([[float(word) for word in line.split()] for line in BODY.splitlines()], "<f4")
    body = {"ascii": BODY, "binary": rows.tobytes(), "binary_compressed": compress(rows)}[data]
    path.write_bytes(pcd_text(width="2", height="2", data=data) + body)

    scan = read_scan(path)

    assert scan.grid_shape == (2, 2)
    assert scan.pixels is not None
    assert scan.pixels.tolist() == [[0, 0], [0, 1], [1, 1]]
    assert scan.pixels.dtype == np.int64
    assert scan.points.tolist() == POINTS


def compress(rows: np.ndarray) -> bytes:
    """PCL's layout: sizes, then the LZF of field after field."""
    plain = np.ascontiguousarray(rows.T).tobytes()
    packed = lzf.compress(plain, 2 * len(plain) + 64)
    return struct.pack("<II", len(packed), len(plain)) + packed


@pytest.mark.parametrize("data", ["ascii", "binary"])
def test_padding_and_long_fields_are_stepped_over(tmp_path: Path, data: str) -> None:
    header = pcd_text(
        fields="_ x _ y hist z", size="1 4 2 4 4 4", kind="U F I F F F", count="3 1 1 1 2 1",
        points="4", data=data,
    )  # fmt: skip
    table = np.zeros(
        4,
        dtype=[("a", "u1", 3), ("x", "<f4"), ("b", "<i2"), ("y", "<f4"), ("h", "<f4", 2),
               ("z", "<f4")],
    )  # fmt: skip
    table["x"], table["y"], table["z"] = np.array([*POINTS, [1, 2, 3]], float).T
    table["a"], table["b"], table["h"] = 200, -5, np.nan
    if data == "binary":
        body = table.tobytes()
    else:
        flat = [[*row["a"], row["x"], row["b"], row["y"], *row["h"], row["z"]] for row in table]
        body = "\n".join(" ".join(map(str, row)) for row in flat).encode()
    (tmp_path / "a.pcd").write_bytes(header + body)

    assert read_scan(tmp_path / "a.pcd").points.tolist() == [*POINTS, [1, 2, 3]]


@pytest.mark.parametrize("alpha", [0, 255])
@pytest.mark.parametrize(
    ("kind", "as_text"),
    [
        ("U", lambda bits: str(bits)),
        ("F", lambda bits: str(bits)),
        ("F", lambda bits: repr(float(np.uint32(bits).view(np.float32)))),
        ("F", lambda bits: f"{np.uint32(bits).view(np.float32):.9g}"),
    ],
)
def test_ascii_colours_as_integers_and_as_the_float_of_the_same_bits(
    tmp_path: Path, alpha: int, kind: str, as_text: object
) -> None:
    assert callable(as_text)
    colors = [(247, 77, 77), (0, 0, 128), (255, 255, 0)]
    lines: list[str] = []
    for point, (red, green, blue) in zip(POINTS, colors, strict=True):
        bits = (alpha << 24) | (red << 16) | (green << 8) | blue
        lines.append(f"{point[0]} {point[1]} {point[2]} {as_text(bits)}")
    header = pcd_text(
        fields="x y z rgb", size="4 4 4 4", kind=f"F F F {kind}", count="1 1 1 1",
        width="3", points="3",
    )  # fmt: skip
    (tmp_path / "a.pcd").write_bytes(header + "\n".join(lines).encode())

    found = read_scan(tmp_path / "a.pcd").colors

    assert found is not None
    is_lost = alpha == 255 and "nan" in "".join(lines)  # 0xFF9.. and up are NaN in words
    for color, line, row in zip(colors, lines, found.tolist(), strict=True):
        assert tuple(row) == ((0, 0, 0) if is_lost and "nan" in line else color)


def test_binary_float_colours_keep_their_bits(tmp_path: Path) -> None:
    table = np.zeros(3, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
    table["x"], table["y"], table["z"] = np.array(POINTS, float).T
    table["rgb"] = [0xFFF74D4D, 0x00000080, 0xFFFFFF00]
    header = pcd_text(
        fields="x y z rgba", size="4 4 4 4", kind="F F F F", count="1 1 1 1", width="3",
        points="3", data="binary",
    )  # fmt: skip
    (tmp_path / "a.pcd").write_bytes(header + table.tobytes())

    colors = read_scan(tmp_path / "a.pcd").colors

    assert colors is not None
    assert colors.tolist() == [[247, 77, 77], [0, 0, 128], [255, 255, 0]]


ROWS = np.array([[0, 0, 100], [100, 0, 0], [0, 100, 0], [1, 2, 3]], "<f4")
PACKED = compress(ROWS)
BROKEN: dict[str, tuple[bytes, str]] = {
    "no pcd": (b"solid x\n" * 5, "a header without FIELDS, SIZE"),
    "binary garbage": (bytes(range(256)) * 4, "a header without FIELDS"),
    "no data line": (pcd_text().rsplit(b"DATA", 1)[0], "a header without DATA"),
    "unknown data": (pcd_text(data="zip") + BODY, "DATA zip"),
    "no z": (pcd_text(fields="x y w") + BODY, "the fields x, y, w, wanted x, y and z"),
    "x twice": (pcd_text(fields="x x z") + BODY, "fields x x z"),
    "sizes missing": (pcd_text(size="4 4") + BODY, "ValueError"),
    "unknown type": (pcd_text(kind="F F Q") + BODY, "field 'z' of type Q4"),
    "float of 2 bytes": (pcd_text(size="4 4 2") + BODY, "field 'z' of type F2"),
    "count 0": (pcd_text(count="1 1 0") + BODY, "field 'z' with COUNT 0"),
    "points differ": (pcd_text(points="5") + BODY, "POINTS 5 for 4 x 1 points"),
    "negative": (pcd_text(width="-4", height="-1") + BODY, "-4 x -1 points"),
    "absurd": (pcd_text(width="9999999999", points=None) + BODY, "at most 50000000"),
    "width no number": (pcd_text(width="four", points=None) + BODY, "ValueError"),
    "no points": (pcd_text(width="0", points="0"), "x, y and z|0 valid of 0"),
    "ascii short": (pcd_text() + BODY[:16], "2 lines of 3 values, wanted 4 of 3"),
    "ascii long": (pcd_text() + BODY * 2, "8 lines of 3 values, wanted 4 of 3"),
    "ascii empty": (pcd_text(), "0 lines of 0 values, wanted 4 of 3"),
    "ascii wide": (pcd_text() + b"1 2 3 4\n" * 4, "4 lines of 4 values"),
    "ascii words": (pcd_text() + b"1 2 x\n" * 4, "ValueError"),
    "binary short": (pcd_text(data="binary") + ROWS.tobytes()[:-1], "a body of 47 bytes"),
    "binary long": (pcd_text(data="binary") + ROWS.tobytes() * 2, "a body of 96 bytes"),
    "packed empty": (pcd_text(data="binary_compressed") + b"1234", "a body of 4 bytes"),
    "packed short": (pcd_text(data="binary_compressed") + PACKED[:-3], "a body of"),
    "packed long": (pcd_text(data="binary_compressed") + PACKED + b"x", "a body of"),
    "packed other size": (
        pcd_text(data="binary_compressed") + PACKED[:4] + struct.pack("<I", 47) + PACKED[8:],
        "47 bytes of points, wanted 4 x 12",
    ),
    "packed broken": (
        pcd_text(data="binary_compressed") + PACKED[:8] + b"\xff" * (len(PACKED) - 8),
        "LZF",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    content, reason = BROKEN[case]
    path = tmp_path / "bad.pcd"
    path.write_bytes(content)

    with pytest.raises(InputFileError, match=reason) as caught:
        read_scan(path)

    assert str(caught.value).startswith(f"{path}: found ")
    assert "\n" not in str(caught.value)
