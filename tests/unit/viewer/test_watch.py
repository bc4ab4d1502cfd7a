"""New scans are noticed once, whole; old ones never."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from boltpose.errors import InputFileError
from boltpose.viewer.watch import FileWatch, FolderWatch

NEVER_S = 50.0
"""The test looks itself."""


def folder_watch(folder: Path, found: list[str], lost: list[str]) -> FolderWatch:
    return FolderWatch(
        folder,
        (".ply", ".png"),
        NEVER_S,
        found=lambda path: found.append(path.name),
        lost=lost.append,
    )


def test_a_scan_is_told_once_when_it_has_stopped_growing(tmp_path: Path) -> None:
    (tmp_path / "old.ply").write_bytes(b"old")
    found: list[str] = []
    watch = folder_watch(tmp_path, found, [])
    try:
        new = tmp_path / "new.PLY"
        new.write_bytes(b"ha")
        watch.look()
        new.write_bytes(b"half and more")
        watch.look()
        assert found == []
        watch.look()
        watch.look()
        assert found == ["new.PLY"]
    finally:
        watch.stop()


def test_what_is_no_scan_or_not_ready_is_left_alone(tmp_path: Path) -> None:
    found: list[str] = []
    watch = folder_watch(tmp_path, found, [])
    try:
        for name in (".a.ply.tmp", ".hidden.ply", "notes.txt", "a.ply.part"):
            (tmp_path / name).write_bytes(b"x")
        (tmp_path / "empty.ply").write_bytes(b"")
        for _ in range(3):
            watch.look()
        assert found == []
    finally:
        watch.stop()


def test_of_several_the_newest_counts_and_one_written_again_is_new(tmp_path: Path) -> None:
    found: list[str] = []
    watch = folder_watch(tmp_path, found, [])
    try:
        for age, name in enumerate(("c.ply", "a.ply", "b.ply")):
            path = tmp_path / name
            path.write_bytes(b"x")
            os.utime(path, ns=(10**18 + age, 10**18 + age))
        watch.look()
        watch.look()
        assert found == ["b.ply"]
        (tmp_path / "a.ply").write_bytes(b"other")
        watch.look()
        watch.look()
        assert found == ["b.ply", "a.ply"]
    finally:
        watch.stop()


def test_a_folder_that_goes_is_told_once_and_may_come_back(tmp_path: Path) -> None:
    folder = tmp_path / "scans"
    folder.mkdir()
    found: list[str] = []
    lost: list[str] = []
    watch = folder_watch(folder, found, lost)
    try:
        folder.rmdir()
        watch.look()
        watch.look()
        assert len(lost) == 1
        assert str(folder) in lost[0]
        folder.mkdir()
        (folder / "a.ply").write_bytes(b"x")
        watch.look()
        watch.look()
        assert found == ["a.ply"]
    finally:
        watch.stop()


def test_no_folder_is_an_error_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="missing: found no such folder"):
        folder_watch(tmp_path / "missing", [], [])


def test_a_file_is_told_when_written_anew_removed_and_back(tmp_path: Path) -> None:
    path = tmp_path / "poses.json"
    path.write_text("1")
    told: list[bool] = []
    watch = FileWatch(path, NEVER_S, changed=told.append)
    try:
        watch.look()
        assert told == []
        path.write_text("22")
        watch.look()
        path.unlink()
        watch.look()
        watch.look()
        path.write_text("22")
        watch.look()
        assert told == [True, False, True]
    finally:
        watch.stop()
