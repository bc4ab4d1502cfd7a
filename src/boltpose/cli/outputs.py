"""Outputs are checked before the work starts, so that nothing is computed for nowhere."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from boltpose.errors import InputFileError

PRIOR_SUFFIXES = (".npz",)
POSES_SUFFIXES = (".json",)
PICTURE_SUFFIXES = (".png", ".svg", ".pdf")
REPORT_SUFFIXES = (".html", ".htm")


def check_output(
    path: Path | None, suffixes: tuple[str, ...], *, inputs: Iterable[Path | None] = ()
) -> None:
    """Refuse a path that cannot be written, has the wrong suffix or would replace an input.

    Args:
        path: Where a file is to be written; None is no output, and fine.
        suffixes: Accepted endings, lower case with dot.
        inputs: Files the command reads; an output over one of them is a typing slip.

    Raises:
        InputFileError: The path will not do; the text says why.
    """
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise InputFileError(
            path, f"the ending '{path.suffix}' for an output", " or ".join(suffixes)
        )
    if path.is_dir():
        raise InputFileError(path, "a folder", "a file name to write to")
    for source in inputs:
        if source is not None and path.resolve() == source.resolve():
            raise InputFileError(path, "an input file given as output", "another name")
    folder = path.parent
    if not folder.is_dir():
        raise InputFileError(path, f"no folder '{folder}'", "an existing folder to write to")
    if not os.access(folder, os.W_OK):
        raise InputFileError(path, f"folder '{folder}' is not writable", "a folder to write to")


def check_folder(path: Path, what: str) -> None:
    """Refuse a folder to write into that is a file, or that nobody may make or write.

    Args:
        path: A folder, there or not.
        what: What is to be written there, for the text.

    Raises:
        InputFileError: The path will not do; the text says why.
    """
    there = next(place for place in (path.absolute(), *path.absolute().parents) if place.exists())
    if not there.is_dir():
        raise InputFileError(there, "a file", f"a folder for {what}")
    if not os.access(there, os.W_OK):
        raise InputFileError(path, f"folder '{there}' is not writable", f"a folder for {what}")


def remove_stale(*paths: Path | None) -> None:
    """Remove results of an earlier run, so that a failed run leaves none a robot could follow.

    Call it after `check_output` has accepted every path. Of a link the file it points to goes,
    which is the one that would be replaced: a robot may know it by its own name.
    """
    for path in paths:
        if path is not None:
            path.resolve().unlink(missing_ok=True)


def remove_stale_poses(path: Path | None) -> None:
    """Remove a `poses.json` of an earlier run, and only that, before inputs are known.

    A settings file that cannot be read does not tell what its inputs are: the output may be one
    of them by a slip, and no calibration must be lost by it.
    """
    if path is None or not path.is_file():
        return
    with path.open("rb") as stream:
        head = stream.read(200)
    if b'"boltpose.poses/' in head:
        path.resolve().unlink()


def check_still_free(path: Path) -> None:
    """Refuse to write where `remove_stale` has made room and another run has written since.

    Two runs into one file: whoever reads it takes one scan's result for the other's. It is removed,
    for it cannot be told which of the two is the later scan.

    Raises:
        InputFileError: The file is there again.
    """
    if path.exists():
        remove_stale(path)
        raise InputFileError(
            path, "another run wrote it meanwhile, so it was removed", "one run at a time per file"
        )
