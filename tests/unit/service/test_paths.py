"""No path leaves its root, whatever it tries."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.service.failures import ServiceError
from boltpose.service.paths import check_prior_name, open_below, safe_name, split_path


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "secret.ply").write_bytes(b"secret")
    folder = tmp_path / "scans"
    (folder / "cell 1").mkdir(parents=True)
    (folder / "cell 1" / "a.ply").write_bytes(b"points")
    (folder / "link.ply").symlink_to(tmp_path / "secret.ply")
    (folder / "inside.ply").symlink_to(folder / "cell 1" / "a.ply")
    (folder / "up").symlink_to(tmp_path)
    os.mkfifo(folder / "pipe.ply")
    return folder


def test_a_file_below_the_root_is_read(root: Path) -> None:
    with open_below(root, "cell 1/a.ply") as stream:
        assert stream.read() == b"points"


@pytest.mark.parametrize(
    "path",
    [
        "",
        "/etc/passwd",
        "//etc/passwd",
        "../secret.ply",
        "cell 1/../../secret.ply",
        "cell 1/..",
        "./cell 1/a.ply",
        "cell 1//a.ply",
        "..\\secret.ply",
        "cell 1\\a.ply",
        "C:secret.ply",
        "C:/secret.ply",
        "c:\\secret.ply",
        "\\\\server\\share",
        "cell 1/a.ply\0.png",
        "a\nb.ply",
        "\x9b31m.ply",
        "a" * 256,
        "/".join("a" * 40),
        "\ud800.ply",
    ],
)
def test_a_path_that_tries_to_leave_is_refused_before_the_disk_is_asked(
    root: Path, path: str
) -> None:
    with pytest.raises(ServiceError) as caught:
        split_path(path)
    assert caught.value.code == "path_not_allowed"
    assert "secret" not in str(caught.value) or "secret" in path


@pytest.mark.parametrize(
    "path", ["link.ply", "inside.ply", "up/secret.ply", "pipe.ply", "cell 1", "none.ply", "a/b/c"]
)
def test_links_pipes_folders_and_missing_files_look_the_same(root: Path, path: str) -> None:
    with pytest.raises(ServiceError) as caught:
        open_below(root, path)
    assert caught.value.code == "no_such_file"
    assert str(caught.value) == f"path {path!a}: no plain file there"


@given(st.text(max_size=60))
def test_what_is_accepted_stays_below_the_root(path: str) -> None:
    root = Path("/srv/scans")
    try:
        parts = split_path(path)
    except ServiceError:
        return
    assert Path(os.path.normpath(root.joinpath(*parts))).is_relative_to(root)
    assert root.joinpath(*parts) != root


@given(st.text(max_size=60))
def test_the_name_of_an_upload_is_only_a_name(text: str) -> None:
    name = safe_name(text, "file")
    assert split_path(name) == (name,)
    assert not name.startswith((".", "-"))


def test_an_upload_keeps_number_and_suffix() -> None:
    assert safe_name("C:\\cell\\000002.png", "file") == "000002.png"
    assert safe_name("../../000002.png", "file") == "000002.png"


@pytest.mark.parametrize(
    "name", ["", ".", "..", ".hidden", "a/b", "a\\b", "a\0", "a..b", "x" * 101]
)
def test_a_prior_cannot_get_a_name_that_is_a_path(name: str) -> None:
    with pytest.raises(ServiceError, match="name"):
        check_prior_name(name)
