"""Processor time of work that may be interrupted and taken up again."""

from __future__ import annotations

import time
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from boltpose.io.atomic import write_atomic

SAVE_EVERY_S = 20.0
"""Processor seconds that a killed process may lose from the sum."""


def read_cpu_s(path: Path) -> float:
    """Processor seconds noted so far; 0 if there is no readable note."""
    try:
        return float(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return 0.0


class CpuClock:
    """Adds the processor time of a block, all threads, to the sum in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before = 0.0
        self._began = 0.0
        self._saved = 0.0

    def tick(self) -> None:
        """Save now and then; cheap enough for every step."""
        spent = time.process_time() - self._began
        if spent - self._saved >= SAVE_EVERY_S:
            self._save(spent)

    def _save(self, spent: float) -> None:
        def write(stream: BinaryIO) -> None:
            stream.write(f"{self._before + spent:.3f}\n".encode())

        write_atomic(self._path, write)
        self._saved = spent

    def __enter__(self) -> CpuClock:
        self._before = read_cpu_s(self._path)
        self._began = time.process_time()
        self._saved = 0.0
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._save(time.process_time() - self._began)
