"""Tell a caller how long each stage took, without a clock in the results."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

OnStage = Callable[[str, float], None]
"""Called after each stage with its name and wall seconds; for progress and reports."""


class StageClock:
    """Reports the time since the stage before."""

    def __init__(self, on_stage: OnStage | None) -> None:
        self._on_stage = on_stage
        self._start = perf_counter()

    def done(self, name: str) -> None:
        """Report that a stage has ended."""
        now = perf_counter()
        if self._on_stage is not None:
            self._on_stage(name, now - self._start)
        self._start = now
