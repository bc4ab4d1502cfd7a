from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.prior.file import write_prior
from boltpose.prior.folder import open_prior_folder
from tests.support import records


def fill(folder: Path, *names: str) -> None:
    for name in names:
        write_prior(folder / f"{name}.prior.npz", replace(records.prior(), name=f"motor {name}"))


def test_priors_are_known_by_the_name_in_the_file(tmp_path: Path) -> None:
    fill(tmp_path, "b", "a")
    (tmp_path / "notes.txt").write_text("no prior")

    folder = open_prior_folder(tmp_path)

    assert [sketch.name for sketch in folder.sketches] == ["motor a", "motor b"]
    assert folder.read("motor b").name == "motor b"
    np.testing.assert_array_equal(folder.read("motor a").points, records.prior().points)


def test_opening_writes_nothing(tmp_path: Path) -> None:
    fill(tmp_path, "a")
    before = [(path.name, path.read_bytes()) for path in sorted(tmp_path.iterdir())]
    open_prior_folder(tmp_path)
    assert [(path.name, path.read_bytes()) for path in sorted(tmp_path.iterdir())] == before


def test_a_folder_without_priors_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"found no \*\.prior\.npz, wanted a folder of"):
        open_prior_folder(tmp_path)
    with pytest.raises(InputFileError, match=r"none: found no such folder"):
        open_prior_folder(tmp_path / "none")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputFileError, match=r"file: found a file, wanted a folder"):
        open_prior_folder(tmp_path / "file")


def test_one_broken_file_among_good_ones_is_named(tmp_path: Path) -> None:
    fill(tmp_path, "a", "b", "c")
    bad = tmp_path / "b.prior.npz"
    bad.write_bytes(bad.read_bytes()[:200])
    with pytest.raises(InputFileError, match=r"b\.prior\.npz: found .*, wanted ") as caught:
        open_prior_folder(tmp_path)
    assert "\n" not in str(caught.value)


def test_two_priors_of_one_name_are_refused(tmp_path: Path) -> None:
    fill(tmp_path, "a")
    (tmp_path / "copy.prior.npz").write_bytes((tmp_path / "a.prior.npz").read_bytes())
    with pytest.raises(
        InputFileError, match=r"copy\.prior\.npz: found the name 'motor a' as in a\.prior\.npz"
    ):
        open_prior_folder(tmp_path)
