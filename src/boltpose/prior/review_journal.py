"""The journal of a review: every act on disk before it is shown, beside the prior."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from boltpose.errors import InputFileError

FORMAT = "boltpose.review/1"
SUFFIX = ".review.jsonl"
_FIRST_BYTES = b'{"format"'
_WANTED = "a journal of `boltpose prior review`"
_DISCARD = "throw it away with --discard, or remove the file"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JournalContent:
    """What a journal says."""

    prior_sha256: str
    """Of the prior its acts begin with."""
    version: str
    """Of the package that wrote it."""
    acts: tuple[dict[str, Any], ...]
    """In order."""


class ReviewJournal:
    """One file of one JSON object per line, held by one process at a time.

    The first line names the prior by its hash. Every other line is an act. A line is written by
    one call and synced to the disk before `append` returns; half a line, as a power cut leaves
    it, is an act that nobody was told was done, and is dropped.
    """

    def __init__(self, path: Path) -> None:
        """Open the journal, an empty one if there is none, and lock it.

        Raises:
            InputFileError: Another process holds it, or it cannot be written.
        """
        self.path = path
        self._fd = _open_locked(path)
        self._count = 0

    @staticmethod
    def path_of(prior: str | Path) -> Path:
        """Where the journal of a prior lies: beside it, so that the two are moved together."""
        place = Path(prior).resolve()
        return place.with_name(place.name + SUFFIX)

    def read(self) -> JournalContent | None:
        """Read all acts, and cut off half a line at the end; None if the journal is empty.

        Raises:
            InputFileError: It is damaged elsewhere, or no journal of a known version.
        """
        raw = _read_all(self._fd)
        whole = raw[: raw.rfind(b"\n") + 1]
        if not whole and not raw.startswith(_FIRST_BYTES[: len(raw)]):
            raise InputFileError(self.path, "what nobody here wrote", f"{_WANTED}; {_DISCARD}")
        lines = [self._parse(number, line) for number, line in enumerate(whole.splitlines(), 1)]
        if not lines:
            return None  # the first line was not finished: no act was made
        head = lines[0]
        if head.get("format") != FORMAT:
            raise InputFileError(self.path, f"format {head.get('format')!r}", f"'{FORMAT}'")
        if [line.get("n") for line in lines[1:]] != list(range(1, len(lines))):
            raise InputFileError(
                self.path, "lines missing or out of order", f"{_WANTED}; {_DISCARD}"
            )
        if len(whole) < len(raw):
            os.ftruncate(self._fd, len(whole))
        return JournalContent(
            prior_sha256=str(head.get("prior_sha256")),
            version=str(head.get("version")),
            acts=tuple(lines[1:]),
        )

    def start(self, prior_sha256: str, version: str) -> None:
        """Empty the journal and write its first line.

        Raises:
            InputFileError: The disk is full or gone.
        """
        os.ftruncate(self._fd, 0)
        self._count = 0
        self._write({"format": FORMAT, "prior_sha256": prior_sha256, "version": version})

    def resume(self, content: JournalContent) -> None:
        """Go on after the acts that were read."""
        self._count = len(content.acts)

    def append(self, act: dict[str, Any]) -> None:
        """Write one act; it is on the disk when this returns.

        Raises:
            InputFileError: The disk is full or gone; nothing of the act stays in the file.
        """
        size = os.fstat(self._fd).st_size
        try:
            self._write({"n": self._count + 1, **act})
        except InputFileError:
            os.ftruncate(self._fd, size)
            raise
        self._count += 1

    def close(self, *, keep: bool) -> None:
        """Let go of the journal; without `keep` the file goes away. Safe to call twice."""
        if self._fd < 0:
            return
        if not keep:
            # while it is still locked: nobody else can have written to it. Windows keeps a file
            # that is open; the next review finds it empty of acts
            with contextlib.suppress(PermissionError):
                self.path.unlink(missing_ok=True)
        os.close(self._fd)
        self._fd = -1

    def _parse(self, number: int, line: bytes) -> dict[str, Any]:
        try:
            data = json.loads(line)
        except (ValueError, RecursionError):
            data = None
        if not isinstance(data, dict):
            raise InputFileError(
                self.path, f"line {number} that is no JSON object", f"{_WANTED}; {_DISCARD}"
            )
        return cast("dict[str, Any]", data)

    def _write(self, data: dict[str, Any]) -> None:
        line = json.dumps(data, sort_keys=True, ensure_ascii=True).encode() + b"\n"
        try:
            if os.write(self._fd, line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._fd)
        except OSError as error:
            raise InputFileError(
                self.path,
                f"that it cannot be written ({reason_of(error)}), so nothing was changed",
                "a disk with room",
            ) from error


def reason_of(error: OSError) -> str:
    """What the system says, to be put in brackets."""
    return (error.strerror or type(error).__name__).lower()


def _open_locked(path: Path) -> int:
    while True:
        try:
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            raise InputFileError(
                path,
                f"no journal can be kept ({reason_of(error)})",
                "a folder to write to beside the prior",
            ) from error
        if not _try_lock(fd):
            os.close(fd)
            raise InputFileError(path, "another open review of this prior", "one at a time")
        # the one who held it before may have removed it just before letting go
        if _is_same(fd, path):
            return fd
        os.close(fd)


def _is_same(fd: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(fd), path.stat())
    except FileNotFoundError:
        return False


def _try_lock(fd: int) -> bool:
    """Lock until the file is closed or the process ends, however it ends."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _read_all(fd: int) -> bytes:
    os.lseek(fd, 0, os.SEEK_SET)
    parts: list[bytes] = []
    while part := os.read(fd, 1 << 20):
        parts.append(part)
    return b"".join(parts)
