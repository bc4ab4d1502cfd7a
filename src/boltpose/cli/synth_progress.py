"""How far a data set is, on stderr."""

from __future__ import annotations

import time

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from boltpose.cli.console import LiveProgress, note, note_console
from boltpose.synthesis.write import Sample


class SampleProgress(LiveProgress):
    """A bar with the time that is left; on a log instead of a terminal, a line now and then."""

    def __init__(self, title: str) -> None:
        console = note_console()
        self._title = title
        self._is_live = console.is_terminal
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not self._is_live,
        )
        self._task = self._progress.add_task(title, total=None)
        self._made = 0
        self._missing = 0
        self._began = time.perf_counter()
        self._stages: dict[str, float] = {}

    def start(self, kept: int, missing: int) -> None:
        """Note how many samples are there and how many are to be made."""
        self._missing = missing
        self._began = time.perf_counter()
        # what was there is left out, or the time left would be counted from it
        description = f"{self._title} ({kept} there)" if kept else self._title
        self._progress.update(self._task, total=missing, description=description)

    def advance(self, sample: Sample) -> None:
        """Note a sample that has been written."""
        self._made += 1
        for stage, seconds in sample.seconds:
            self._stages[stage] = self._stages.get(stage, 0.0) + seconds
        self._progress.advance(self._task)
        if not self._is_live and (self._made % 50 == 0 or self._made == self._missing):
            note(f"{self._title}: {self._made} of {self._missing}, {self.summary()}")

    def summary(self) -> str:
        """Return for example `1.9 s per motor (build 0.6 s, scan 1.1 s of one core)`."""
        made = max(1, self._made)
        stages = ", ".join(f"{name} {total / made:.2f} s" for name, total in self._stages.items())
        wall = (time.perf_counter() - self._began) / made
        return f"{wall:.2f} s per motor ({stages} of one core)"
