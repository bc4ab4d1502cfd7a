from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.io import read_scan
from tests.unit.io.clouds import make_cloud

CLOUD = make_cloud()


@pytest.mark.parametrize("key", ["points", "xyz"])
@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", "<f2", "<i2", ">i8"])
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_flat_arrays_of_any_type(tmp_path: Path, key: str, dtype: str, save: Any) -> None:
    points = CLOUD.points.astype(dtype)
    save(
        tmp_path / "a.npz",
        **{key: points},
        colors=CLOUD.colors,
        normals=CLOUD.normals,
        labels=CLOUD.labels.astype(np.int64),
        extra=np.array([None]),
    )

    scan = read_scan(tmp_path / "a.npz")

    np.testing.assert_array_equal(scan.points, points.astype(float))
    np.testing.assert_array_equal(scan.colors, CLOUD.colors)
    np.testing.assert_array_equal(scan.normals, CLOUD.normals)
    np.testing.assert_array_equal(scan.labels, CLOUD.labels)
    assert scan.grid_shape is None


def test_organised_arrays_keep_their_grid(tmp_path: Path) -> None:
    grid = CLOUD.points.reshape(*CLOUD.shape, 3).copy()
    grid[1, 2] = np.nan
    grid[3, :] = 0
    np.savez(
        tmp_path / "a.npz",
        xyz=grid,
        colors=CLOUD.colors.reshape(grid.shape) / 255.0,
        labels=CLOUD.labels.reshape(CLOUD.shape),
    )

    scan = read_scan(tmp_path / "a.npz")

    assert scan.grid_shape == CLOUD.shape
    assert scan.pixels is not None
    assert len(scan) == 40 - 1 - 8
    rows, columns = scan.pixels.T
    np.testing.assert_array_equal(scan.points, grid[rows, columns])
    np.testing.assert_array_equal(scan.labels, CLOUD.labels.reshape(CLOUD.shape)[rows, columns])
    np.testing.assert_array_equal(scan.colors, CLOUD.colors.reshape(grid.shape)[rows, columns])


class _Bomb:
    """Would leave a trace if it were ever unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (exec, ("import pathlib; pathlib.Path('unpickled').touch()",))


def test_nothing_is_unpickled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("object.npz", points=np.array([[_Bomb()] * 3] * 3, dtype=object))
    Path("bare.npz").write_bytes(np.array([_Bomb()]).dumps())

    for name in ("object.npz", "bare.npz"):
        with pytest.raises(InputFileError, match="not pickled"):
            read_scan(name)

    assert not Path("unpickled").exists()


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"cloud": CLOUD.points}, "the arrays cloud"),
        ({"points": CLOUD.points, "xyz": CLOUD.points}, "the arrays points, xyz"),
        ({"points": CLOUD.points.T}, r"`points` of shape \(3, 40\)"),
        ({"points": np.zeros(())}, r"`points` of shape \(\)"),
        ({"points": np.zeros((2, 2, 2, 3))}, r"`points` of shape \(2, 2, 2, 3\)"),
        ({"points": CLOUD.points.astype(complex)}, "`points` of type complex128"),
        ({"points": CLOUD.points.astype(str)}, "`points` of type <U"),
        ({"points": CLOUD.points, "labels": CLOUD.labels[:-1]}, r"`labels` of shape \(39,\)"),
        ({"points": CLOUD.points, "colors": CLOUD.colors[:, :2]}, r"`colors` of shape \(40, 2\)"),
        ({"points": CLOUD.points, "normals": CLOUD.normals[:1]}, r"`normals` of shape \(1, 3\)"),
        ({"points": CLOUD.points, "labels": CLOUD.labels + 7}, "label .*, wanted 0 background"),
    ],
)
def test_other_arrays_are_refused(tmp_path: Path, arrays: dict[str, Any], reason: str) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputFileError, match=reason):
        read_scan(tmp_path / "a.npz")


def test_an_array_that_claims_to_be_huge_is_refused_unread(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (900000000, 3), }"
        size = (len(head) + 1).to_bytes(2, "little")
        archive.writestr("points.npy", b"\x93NUMPY\x01\x00" + size + head + b"\n" + bytes(1000))
    with pytest.raises(InputFileError, match=r"a\.npz: found"):
        read_scan(tmp_path / "a.npz")
