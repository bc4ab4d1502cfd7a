"""Notice files that are written while the page is open."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from boltpose.errors import InputFileError

Signature = tuple[int, int, int]
"""Size, time of the last change in ns, and inode: a file with another one was written anew."""


class FolderWatch:
    """Tells of every scan that is written to a folder, once it is complete.

    A file counts as complete when it has not changed between two looks. What lay there before is
    left alone: it is no new scan.
    """

    def __init__(
        self,
        folder: Path,
        suffixes: tuple[str, ...],
        poll_s: float,
        *,
        found: Callable[[Path], None],
        lost: Callable[[str], None],
    ) -> None:
        """Start to look.

        Args:
            folder: Not its subfolders.
            suffixes: Lower case, with dot.
            poll_s: Seconds between two looks.
            found: Told every new or changed file; of several at once only the newest.
            lost: Told once, in one line, when the folder cannot be read any more.

        Raises:
            InputFileError: There is no such folder.
        """
        if not folder.is_dir():
            raise InputFileError(
                folder, "a file" if folder.exists() else "no such folder", "a folder to watch"
            )
        self._folder, self._suffixes = folder, suffixes
        self._found, self._lost = found, lost
        self._known = self._look()
        self._growing: dict[Path, Signature] = {}
        self._is_lost = False
        self._timer = _Timer(poll_s, self.look, f"watch {folder}")

    def look(self) -> None:
        """Look once; the thread does this all the time."""
        try:
            now = self._look()
        except OSError as error:
            if not self._is_lost:
                self._is_lost = True
                self._lost(f"{self._folder}: {error.strerror or error}")
            return
        self._is_lost = False
        changed = {path: sign for path, sign in now.items() if self._known.get(path) != sign}
        complete = [path for path, sign in changed.items() if self._growing.get(path) == sign]
        self._growing = {path: sign for path, sign in changed.items() if path not in complete}
        for path in complete:
            self._known[path] = changed[path]
        # a file that was removed and comes again is a new scan
        self._known = {path: sign for path, sign in self._known.items() if path in now}
        if complete:
            self._found(max(complete, key=lambda path: (changed[path][1], path.name)))

    def stop(self) -> None:
        """Look no more."""
        self._timer.stop()

    def _look(self) -> dict[Path, Signature]:
        found: dict[Path, Signature] = {}
        for path in sorted(self._folder.iterdir()):
            if path.suffix.lower() not in self._suffixes or path.name.startswith("."):
                continue
            sign = _signature(path)
            if sign is not None and sign[0] > 0:
                found[path] = sign
        return found


class FileWatch:
    """Tells when one file was written anew, removed, or has come back."""

    def __init__(self, path: Path, poll_s: float, *, changed: Callable[[bool], None]) -> None:
        """Start to look.

        Args:
            path: The file as it is now is the one that is known.
            poll_s: Seconds between two looks.
            changed: Told whether the file is there.
        """
        self._path, self._changed = path, changed
        self._known = _signature(path)
        self._timer = _Timer(poll_s, self.look, f"watch {path}")

    def look(self) -> None:
        """Look once; the thread does this all the time."""
        now = _signature(self._path)
        if now != self._known:
            self._known = now
            self._changed(now is not None)

    def stop(self) -> None:
        """Look no more."""
        self._timer.stop()


class _Timer:
    def __init__(self, poll_s: float, look: Callable[[], None], name: str) -> None:
        self._poll_s, self._look = poll_s, look
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=10.0)

    def _run(self) -> None:
        while not self._stopped.wait(self._poll_s):
            self._look()


def _signature(path: Path) -> Signature | None:
    """What tells one state of a file from another; None if there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns, status.st_ino
