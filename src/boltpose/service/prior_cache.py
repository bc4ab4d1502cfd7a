"""Priors ready for registration, kept by their content; the memory they take is bounded."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from boltpose.errors import ConfigError
from boltpose.prior.file import read_prior, read_sketch
from boltpose.registration.library import PriorLibrary
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.schema import Prior
from boltpose.service.blobs import Blob, BlobStore

_LIBRARIES = 2
_TREE_BYTES_PER_POINT = 64
"""A scipy KDTree over float64 points: 24 for the points, 8 for the index, the rest for nodes."""


class PriorCache:
    """Prepared priors by SHA-256, the least recently used dropped first.

    What is found never depends on what is kept. Not to be shared by threads.
    """

    def __init__(self, blobs: BlobStore, memory_mb: float) -> None:
        """Start empty.

        Args:
            blobs: Where the files are.
            memory_mb: Most memory for prepared priors; the one in use always stays.
        """
        self._blobs = blobs
        self._limit = int(memory_mb * 1e6)
        self._prepared: OrderedDict[str, tuple[PreparedPrior, int]] = OrderedDict()
        self._libraries: OrderedDict[tuple[str, ...], PriorLibrary] = OrderedDict()

    @property
    def size(self) -> int:
        """Bytes that the prepared priors take."""
        return sum(size for _, size in self._prepared.values())

    def __len__(self) -> int:
        return len(self._prepared)

    def prepared(self, blob: Blob) -> PreparedPrior:
        """Return a prior ready for registration.

        Raises:
            InputFileError: Its file is damaged.
        """
        if blob.sha256 not in self._prepared:
            prepared = prepare_prior(read_prior(self._blobs.find(blob)))
            self._prepared[blob.sha256] = (prepared, bytes_of(prepared))
        self._prepared.move_to_end(blob.sha256)
        while self.size > self._limit and len(self._prepared) > 1:
            self._prepared.popitem(last=False)
        return self._prepared[blob.sha256][0]

    def library(self, blobs: tuple[Blob, ...]) -> PriorLibrary:
        """Return the motors to choose from; preparing them shares this cache.

        Raises:
            InputFileError: A file is damaged.
            ConfigError: Two motors have the same name.
        """
        key = tuple(sorted(blob.sha256 for blob in blobs))
        if key not in self._libraries:
            sketches = [read_sketch(self._blobs.find(blob)) for blob in blobs]
            by_name: dict[str, Blob] = {}
            for sketch, blob in zip(sketches, blobs, strict=True):
                if sketch.name in by_name:
                    raise ConfigError(
                        f"{blob.name} and {by_name[sketch.name].name} are both of motor "
                        f"'{sketch.name}': wanted another name per motor"
                    )
                by_name[sketch.name] = blob

            def read(name: str) -> Prior:
                return read_prior(self._blobs.find(by_name[name]))

            mean_bytes = 25e6
            kept = max(2, int(self._limit / mean_bytes / _LIBRARIES))
            self._libraries[key] = PriorLibrary(sketches, read, kept=kept)
        self._libraries.move_to_end(key)
        while len(self._libraries) > _LIBRARIES:
            self._libraries.popitem(last=False)
        return self._libraries[key]


def bytes_of(record: Any) -> int:
    """Estimate the memory behind a record of arrays; search trees by the number of points."""
    seen: set[int] = set()

    def count(value: Any) -> int:
        if id(value) in seen:
            return 0
        seen.add(id(value))
        if isinstance(value, np.ndarray):
            return int(value.nbytes)
        if hasattr(value, "n") and hasattr(value, "leafsize"):
            return int(value.n) * _TREE_BYTES_PER_POINT
        if is_dataclass(value):
            return sum(count(getattr(value, entry.name)) for entry in fields(value))
        if isinstance(value, tuple | list):
            return sum(count(entry) for entry in value)
        return 0

    return count(record)
