"""Processor time by stage, for progress; never part of a result."""

from __future__ import annotations

import time
from collections.abc import Generator
from contextlib import contextmanager


class Stopwatch:
    """Adds up the time of stages by name."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Count what happens inside, also when it fails."""
        start = time.process_time()
        try:
            yield
        finally:
            self._seconds[name] = self._seconds.get(name, 0.0) + time.process_time() - start

    @property
    def seconds(self) -> tuple[tuple[str, float], ...]:
        """Stages in the order in which they first ended."""
        return tuple(self._seconds.items())
