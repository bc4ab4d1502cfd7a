"""Where the command line writes: answers to stdout, progress and warnings to stderr."""

from __future__ import annotations

import json
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

TABLE_WIDTH = 116
"""Columns a table of bolts needs; a narrower terminal wraps lines rather than cut off numbers."""


@dataclass(slots=True)
class Output:
    """How the running command talks; `main` sets it anew for every command line."""

    is_quiet: bool = False
    """No notes and no progress; warnings and errors stay."""
    is_json: bool = False
    """Stdout is for one JSON document."""
    has_answered: bool = False
    """That document is out; an error after it goes to stderr only."""
    interruption: str = "interrupted"
    """What is said after Ctrl-C; long commands say here what they have kept."""

    def reset(self) -> None:
        """Talk as by default."""
        self.is_quiet = self.is_json = self.has_answered = False
        self.interruption = "interrupted"


OUTPUT = Output()


def answer_console() -> Console:
    """Return the console of stdout; colour only on a terminal, NO_COLOR is honoured."""
    return _at_least_wide(Console(highlight=False, quiet=OUTPUT.is_json))


def note_console() -> Console:
    """Return the console of stderr; silent with `--quiet`, so not for warnings and errors."""
    return _at_least_wide(Console(stderr=True, highlight=False, quiet=OUTPUT.is_quiet))


def answer_text(text: str) -> None:
    """Print an answer of words, as it stands; nothing with `--json`."""
    answer_console().print(text, markup=False, soft_wrap=True)


def note(text: str) -> None:
    """Say something beside the answer: a line on stderr, as it stands; nothing with `--quiet`."""
    note_console().print(text, markup=False, soft_wrap=True)


def note_aside(text: str) -> None:
    """Say on stderr what is hardly ever of interest."""
    note_console().print(text, style="dim", markup=False, soft_wrap=True)


def answer_json(answer: Any) -> bool:
    """Print an answer as JSON if that is asked for, and say whether it was."""
    if OUTPUT.is_json:
        typer.echo(json.dumps(answer, indent=2))
        OUTPUT.has_answered = True
    return OUTPUT.is_json


def _at_least_wide(console: Console) -> Console:
    console.width = max(console.width, TABLE_WIDTH)
    return console


def warn(text: str) -> None:
    """Say something that must not be overlooked; one line on stderr, whatever stdout carries."""
    console = _at_least_wide(Console(stderr=True, highlight=False))
    console.print("[bold yellow]warning:[/] ", end="")
    console.print(text, soft_wrap=True, markup=False)


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
            disable=quiet or OUTPUT.is_quiet or not console.is_terminal,
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
