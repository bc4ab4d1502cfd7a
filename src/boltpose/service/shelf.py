"""The folder of priors as the service sees it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from boltpose.prior.folder import PRIOR_PATTERN
from boltpose.service.blobs import Blob, BlobStore
from boltpose.service.failures import ServiceError

SUFFIX = PRIOR_PATTERN.removeprefix("*")


class PriorShelf:
    """Priors by the name of their file without `.prior.npz`.

    A request's name is looked up among the files that are there; it never becomes a path. The
    bytes are copied into the store when they are used, so that a job and its replay see the same
    prior, whatever happens to the folder meanwhile.
    """

    def __init__(self, folder: Path, blobs: BlobStore) -> None:
        """Open the folder, or make it."""
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self._blobs = blobs
        self._known: dict[tuple[str, int, int, int, int], Blob] = {}

    def names(self) -> list[str]:
        """Names of all priors, sorted.

        Raises:
            ServiceError: One is a link that leaves the folder.
        """
        return [path.name.removesuffix(SUFFIX) for path in self._paths()]

    def path(self, name: str) -> Path:
        """The file of a name.

        Raises:
            ServiceError: There is none.
        """
        for path in self._paths():
            if path.name == name + SUFFIX:
                return path
        raise _unknown(name)

    def new_path(self, name: str) -> Path:
        """Where a new prior of a checked name goes."""
        return self.folder / (name + SUFFIX)

    def take(self, name: str) -> Blob:
        """The bytes of a prior, in the store.

        Raises:
            ServiceError: There is none of that name.
        """
        try:
            return self._take(self.path(name))
        except FileNotFoundError:  # deleted this moment
            raise _unknown(name) from None

    def take_all(self) -> tuple[Blob, ...]:
        """The bytes of all priors, in the order of their names."""
        blobs: list[Blob] = []
        for path in self._paths():
            with suppress(FileNotFoundError):  # deleted this moment
                blobs.append(self._take(path))
        return tuple(blobs)

    def _take(self, path: Path) -> Blob:
        state = path.stat()
        # `ctime` changes with every write, also where somebody sets `mtime` back
        key = (path.name, state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns)
        blob = self._known.get(key)
        if blob is None or not self._blobs.path(blob.sha256).is_file():
            blob = self._blobs.add_file(path, path.name)
            self._known[key] = blob
        return blob

    def _paths(self) -> list[Path]:
        root = self.folder.resolve()
        paths = sorted(self.folder.glob(PRIOR_PATTERN))
        for path in paths:
            if path.is_symlink() and not path.resolve().is_relative_to(root):
                # leaving it out in silence would make the service forget a motor
                raise ServiceError(
                    500,
                    "bad_prior_folder",
                    f"{path.name} is a link out of the folder of priors: wanted a file",
                )
        return [path for path in paths if path.is_file() and not path.name.startswith(".")]


def prior_name(blob: Blob) -> str:
    """What clients call a prior."""
    return blob.name.removesuffix(SUFFIX)


def _unknown(name: str) -> ServiceError:
    return ServiceError(
        404, "unknown_prior", f"prior {name[:80]!a}: no such motor, see GET /v1/priors"
    )


def lock_folder(data: Path) -> int:
    """Take a service's folder for this process; returns the handle that holds it.

    Raises:
        BlockingIOError: Another service holds it.
    """
    import fcntl

    handle = os.open(data / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise
    return handle
