"""Bytes that requests came with, kept under their SHA-256."""

from __future__ import annotations

import hashlib
import os
import secrets
import time
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from boltpose.errors import InputFileError
from boltpose.service.failures import ServiceError

_CHUNK = 1 << 20
_YOUNG_S = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Blob:
    """A file as a request named it, and where its bytes are."""

    name: str
    """Only a name, no path; or the path below the scan folder that the request gave."""
    sha256: str
    size: int

    @property
    def file_name(self) -> str:
        """The last part of the name."""
        return self.name.rsplit("/", 1)[-1]


class BlobStore:
    """A folder of files named by their content; the same bytes are kept once."""

    def __init__(self, folder: Path) -> None:
        """Open, or make, the folder; what a crash left half-written is removed.

        Raises:
            OSError: It cannot be made.
        """
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def clean(self) -> None:
        """Remove what a crash left; only the owner of the folder may call this."""
        for stray in self.folder.glob("*.tmp"):
            stray.unlink(missing_ok=True)

    def add(self, stream: BinaryIO, name: str, limit: int) -> Blob:
        """Copy a stream into the store, if its bytes are not there yet.

        Args:
            stream: Read to its end; can be read from any place again.
            name: What the request calls it.
            limit: Most bytes taken.

        Raises:
            ServiceError: The stream is longer.
            OSError: The disk is full.
        """
        digest = hashlib.sha256()
        size = 0
        begin = stream.tell()
        while chunk := stream.read(_CHUNK):
            size += len(chunk)
            if size > limit:
                raise ServiceError(413, "too_large", f"{name}: wanted at most {limit / 1e6:g} MB")
            digest.update(chunk)
        place = self.path(digest.hexdigest())
        if place.is_file():
            os.utime(place)  # young again, see `sweep`
        else:
            stream.seek(begin)
            self._copy(stream, digest.hexdigest(), name)
        return Blob(name=name, sha256=digest.hexdigest(), size=size)

    def add_file(self, path: Path, name: str) -> Blob:
        """Copy a file of our own into the store, if its bytes are not there yet."""
        with path.open("rb") as stream:
            return self.add(stream, name, 1 << 62)

    def _copy(self, stream: BinaryIO, sha256: str, name: str) -> None:
        place = self.path(sha256)
        temporary = self.folder / f"{secrets.token_hex(8)}.tmp"
        digest = hashlib.sha256()
        try:
            with temporary.open("xb") as target:
                while chunk := stream.read(_CHUNK):
                    digest.update(chunk)
                    target.write(chunk)
                target.flush()
                os.fsync(target.fileno())
            if digest.hexdigest() != sha256:
                raise ServiceError(409, "file_changed", f"{name}: it was written while it was read")
            place.parent.mkdir(exist_ok=True)
            temporary.replace(place)
        finally:
            temporary.unlink(missing_ok=True)

    def path(self, sha256: str) -> Path:
        """Where the bytes of a hash are, if they are there."""
        return self.folder / sha256[:2] / sha256

    def find(self, blob: Blob) -> Path:
        """Return the file of a blob.

        Raises:
            InputFileError: It was deleted, see `keep_inputs_days`.
        """
        path = self.path(blob.sha256)
        if not path.is_file():
            raise InputFileError(blob.name, "no stored bytes any more", "an input still kept")
        return path

    def sweep(self, keep: set[str]) -> int:
        """Delete all bytes but those of some hashes; returns how many files went.

        Files younger than an hour stay: their request may not be in the journal yet.
        """
        oldest = time.time() - _YOUNG_S
        gone = 0
        for path in self.folder.glob("[0-9a-f][0-9a-f]/*"):
            if path.name not in keep and path.stat().st_mtime < oldest:
                path.unlink(missing_ok=True)
                gone += 1
        return gone
