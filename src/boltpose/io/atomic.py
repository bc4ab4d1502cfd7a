"""Files appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO


def write_atomic(path: str | Path, write: Callable[[BinaryIO], None]) -> None:
    """Write a file under a temporary name in the same folder, then rename it into place.

    A reader, or a crash at any moment, sees the old file or the new one, never half of it. A
    symbolic link is followed, so the file it points to is the one replaced.

    Args:
        path: The file to make or replace; its folder must exist.
        write: Called once with the open temporary file. Whatever it raises is passed on, and
            `path` is left as it was.

    Raises:
        OSError: The folder is missing or not writable, `path` is a folder, or the disk is full.
    """
    target = Path(path).resolve()
    # no tempfile.mkstemp: its files are private to the user, results are not
    temporary = target.with_name(f".{target.name}.{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
