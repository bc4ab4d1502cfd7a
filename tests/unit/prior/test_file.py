from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.prior.file import prior_to_json, read_prior, write_prior
from tests.support import records


def test_round_trip_keeps_every_field(tmp_path: Path) -> None:
    prior = records.prior()
    write_prior(tmp_path / "m.prior.npz", prior)
    again = read_prior(tmp_path / "m.prior.npz")

    assert prior_to_json(again) == prior_to_json(prior)
    np.testing.assert_array_equal(again.points, prior.points)
    np.testing.assert_array_equal(again.normals, prior.normals)
    np.testing.assert_array_equal(again.labels, prior.labels)


def test_same_prior_same_bytes(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        write_prior(tmp_path / name, records.prior())
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_damaged_files_are_named_in_one_line(tmp_path: Path) -> None:
    good = tmp_path / "good.npz"
    write_prior(good, records.prior())
    data = good.read_bytes()
    rng = np.random.default_rng(0)
    for cut in rng.integers(0, len(data) - 1, 25):
        bad = tmp_path / "bad.npz"
        bad.write_bytes(data[:cut])
        with pytest.raises(InputFileError, match=r"bad\.npz: found .*, wanted ") as caught:
            read_prior(bad)
        assert "\n" not in str(caught.value)


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    bad = tmp_path / "bad.npz"
    np.savez(bad, header=np.array({"format": "boltpose.prior/1"}, dtype=object))
    with pytest.raises(InputFileError, match="no readable archive"):
        read_prior(bad)


def test_another_version_is_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.npz"
    np.savez(bad, header=np.array('{"format": "boltpose.prior/9"}'))
    with pytest.raises(InputFileError, match=r"'boltpose.prior/9', wanted 'boltpose.prior/1'"):
        read_prior(bad)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"none\.npz: found no such file"):
        read_prior(tmp_path / "none.npz")


def test_a_prior_that_would_unpack_to_gigabytes_is_refused_unread(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.prior.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("header.npy", b"none")
        with archive.open("points.npy", "w", force_zip64=True) as stream:
            for _ in range(1300):
                stream.write(bytes(1_000_000))

    with pytest.raises(InputFileError, match=r"bomb\.prior\.npz: found an array above 1\.2 GB"):
        read_prior(bomb)


def test_an_array_that_claims_more_than_it_holds_is_refused(tmp_path: Path) -> None:
    liar = tmp_path / "liar.prior.npz"
    write_prior(liar, records.prior())
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": (10**13, 3)}
    )
    with zipfile.ZipFile(liar) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(liar, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, header.getvalue() if name == "points.npy" else data)

    with pytest.raises(InputFileError, match=r"liar\.prior\.npz: found no readable archive"):
        read_prior(liar)
