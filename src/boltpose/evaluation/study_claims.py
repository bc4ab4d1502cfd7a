"""Claims: of several processes that work at one study, which one does a run."""

from __future__ import annotations

import contextlib
import os
import platform
import sys
from collections.abc import Generator
from pathlib import Path


@contextlib.contextmanager
def claim(path: Path) -> Generator[bool]:
    """Try to claim a piece of work for as long as the block runs.

    The claim is a lock on a file that says who holds it. The system drops the lock when its
    holder ends, however it ends, so the file of a killed process claims nothing.

    Args:
        path: File to lock; its folder must exist. Removed at the end.

    Yields:
        Whether the claim was granted; False while another process holds it.
    """
    if sys.platform == "win32":  # pragma: no cover  no flock there: one process at a time
        yield True
        return
    import fcntl

    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        if not _is_at(descriptor, path):
            yield False  # its last holder removed it between our two calls: ask again
            return
        os.truncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()} {platform.node()}\n".encode(), 0)
        try:
            yield True
        finally:
            path.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


def claimant(path: Path) -> str:
    """Process number and machine written in a claim; `another process` if it cannot be read."""
    try:
        number, machine = path.read_text(encoding="utf-8").split(maxsplit=1)
    except (OSError, ValueError):
        return "another process"
    return f"process {number} on {machine.strip()}"


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
