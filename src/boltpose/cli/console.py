"""Where the command line writes: answers to stdout, progress and warnings to stderr."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

TABLE_WIDTH = 116
"""Columns a table of bolts needs; a narrower terminal wraps lines rather than cut off numbers."""


def answer_console() -> Console:
    """Return the console of stdout; colour only on a terminal, NO_COLOR is honoured."""
    return _at_least_wide(Console(highlight=False))


def note_console() -> Console:
    """Return the console of stderr."""
    return _at_least_wide(Console(stderr=True, highlight=False))


def _at_least_wide(console: Console) -> Console:
    console.width = max(console.width, TABLE_WIDTH)
    return console


def warn(text: str) -> None:
    """Say something that must not be overlooked; one line on stderr, whatever stdout carries."""
    console = note_console()
    console.print(f"[bold yellow]warning:[/] {text}", soft_wrap=True)


class LiveProgress:
    """Something with a rich `Progress` that is drawn between `with` and its end."""

    _progress: Progress

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()


class StageProgress(LiveProgress):
    """Shows the stage that ended last while work goes on, and keeps the time of every stage.

    Draws on stderr, and only on a terminal: a log gets no control characters. Pass `done` as
    `on_stage`.
    """

    def __init__(self, title: str, *, quiet: bool = False) -> None:
        console = note_console()
        self._title = title
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=quiet or not console.is_terminal,
        )
        self._task = self._progress.add_task(title, total=None)
        self.seconds: dict[str, float] = {}
        """Wall seconds by stage, in order."""

    def done(self, stage: str, seconds: float) -> None:
        """Note that a stage has ended."""
        self.seconds[stage] = self.seconds.get(stage, 0.0) + seconds
        self._progress.update(self._task, description=f"{self._title} [dim]({stage} done)[/]")

    def summary(self) -> str:
        """Return for example `segment 0.41 s, register 0.52 s; 0.93 s in all`."""
        stages = ", ".join(f"{stage} {time:.2f} s" for stage, time in self.seconds.items())
        return f"{stages}; {sum(self.seconds.values()):.2f} s in all"
