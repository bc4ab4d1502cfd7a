"""How far a training is, on stderr."""

from __future__ import annotations

from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from boltpose.cli.console import LiveProgress, note, note_console

_LINES = 10
"""On a log instead of a terminal: so many lines per thing that is done."""


class TrainProgress(LiveProgress):
    """One bar per thing that is fitted; on a log, a line every tenth of it."""

    def __init__(self) -> None:
        self._console = note_console()
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed}/{task.total}{task.fields[loss]}"),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._tasks: dict[str, TaskID] = {}

    def step(self, what: str, step: int, steps: int, loss: float) -> None:
        """Note a step, counted from 0; what is computed before the training has no loss."""
        shown = f", loss {loss:.4f}" if loss else ""
        if not self._console.is_terminal:
            if (step + 1) % max(1, steps // _LINES) == 0:
                note(f"{what}: {step + 1}/{steps}{shown}")
            return
        if what not in self._tasks:
            self._tasks[what] = self._progress.add_task(what, total=steps, loss=shown)
        self._progress.update(self._tasks[what], completed=step + 1, total=steps, loss=shown)
