"""Files that a request names: opened below one folder, whatever the name tries."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import BinaryIO

from boltpose.service.failures import ServiceError

_DRIVE = re.compile(r"[A-Za-z]:")
_MAX_PARTS = 32
_MAX_NAME_BYTES = 255
_PRIOR_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ -]{0,99}")


def split_path(text: str) -> tuple[str, ...]:
    """Split a path of a request into the names of folders and file.

    Raises:
        ServiceError: It is absolute, goes up, has a drive, a backslash or a control character.
    """
    parts = tuple(text.split("/"))
    is_allowed = (
        0 < len(parts) <= _MAX_PARTS
        and "\\" not in text
        and not any(ord(letter) < 32 or 0x7F <= ord(letter) < 0xA0 for letter in text)
        and not _DRIVE.match(text)
        and all(part not in ("", ".", "..") for part in parts)
        and all(0 < _bytes_of(part) <= _MAX_NAME_BYTES for part in parts)
    )
    if not is_allowed:
        raise _not_allowed(text)
    return parts


def open_below(root: Path, text: str) -> BinaryIO:
    """Open a plain file below a folder for reading.

    Every folder on the way is opened by its name in the one before, and symbolic links are not
    followed: nobody can swap a folder for a link between a check and its use.

    Args:
        root: The folder; may itself be a link, that is the administrator's word.
        text: The path of the request, with forward slashes.

    Raises:
        ServiceError: The path is not allowed, or there is no plain file.
    """
    parts = split_path(text)
    if os.open not in os.supports_dir_fd:
        return _open_resolved(root, parts, text)
    try:
        folder = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        raise ServiceError(500, "no_scan_folder", "the service's scan folder is gone") from None
    try:
        for part in parts[:-1]:
            inner = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=folder)
            os.close(folder)
            folder = inner
        # not blocking: a pipe without a writer would hang
        handle = os.open(parts[-1], os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    except OSError:
        raise _no_file(text) from None
    finally:
        os.close(folder)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise _no_file(text)
    return os.fdopen(handle, "rb")


def safe_name(text: str | None, fallback: str) -> str:
    """Turn the file name of an upload into one that is only a name.

    The stem and the suffix are kept: the suffix tells the format, and the stem of a depth image
    is its number.
    """
    name = (text or "").replace("\\", "/").rsplit("/", 1)[-1]
    name = re.sub(r"[^A-Za-z0-9._-]", "_", name)[-100:].lstrip(".-")
    return name or fallback


def check_prior_name(name: str) -> str:
    """Check the name of a new prior's file, without its suffix.

    Raises:
        ServiceError: It is no plain name.
    """
    if not _PRIOR_NAME.fullmatch(name) or ".." in name or name.endswith((" ", ".")):
        raise ServiceError(
            422,
            "bad_name",
            f"name: found {name[:60]!r}, wanted letters, digits, space, dot, dash or underscore, "
            "at most 100",
        )
    return name


def _open_resolved(root: Path, parts: tuple[str, ...], text: str) -> BinaryIO:
    """For systems that cannot open relative to a folder (Windows)."""
    base = root.resolve()
    file = base.joinpath(*parts)
    if file.resolve() != file or not file.is_relative_to(base) or not file.is_file():
        raise _no_file(text)
    return file.open("rb")


def _bytes_of(part: str) -> int:
    try:
        return len(part.encode())
    except UnicodeEncodeError:
        return 0


def _not_allowed(text: str) -> ServiceError:
    return ServiceError(
        422,
        "path_not_allowed",
        f"path {text[:80]!a}: wanted a path below the service's scan folder, with forward "
        "slashes and without '..'",
    )


def _no_file(text: str) -> ServiceError:
    # the same words for a missing file, a folder and a link: nothing is told about the disk
    return ServiceError(422, "no_such_file", f"path {text[:80]!a}: no plain file there")
