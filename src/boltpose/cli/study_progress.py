"""How far the study is, on stderr."""

from __future__ import annotations

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from boltpose.cli.console import LiveProgress, note_console
from boltpose.evaluation.study_records import StudyRecord


class MotorProgress(LiveProgress):
    """A bar for the motors of an evaluation; on a log, a line per finished motor."""

    def __init__(self, title: str) -> None:
        """Show nothing yet."""
        self._console = note_console()
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:.0f}/{task.total:.0f}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
            transient=True,
        )
        self._task = self._progress.add_task(title, total=1)

    def done(self, name: str, done: int, count: int) -> None:
        """Note a finished motor."""
        self._progress.update(self._task, completed=done, total=count)
        self._console.print(f"{done}/{count}  {name}", markup=False, soft_wrap=True)


class StudyProgress(LiveProgress):
    """A bar for the runs and one for the training at hand; on a log, a line per finished run."""

    def __init__(self, title: str, runs: int) -> None:
        """Show nothing yet.

        Args:
            title: What is run.
            runs: Number of runs, finished ones included.
        """
        self._console = note_console()
        self._runs = runs
        self._done = 0
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:.0f}/{task.total:.0f}{task.fields[loss]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
            transient=True,
        )
        self._all = self._progress.add_task(title, total=runs, loss="")
        self._current = self._progress.add_task("", total=1, loss="", visible=False)
        self._what = ""
        self._waits_for = ""

    def step(self, what: str, step: int, steps: int, loss: float) -> None:
        """Note a step of a training."""
        if what != self._what:
            self._what = what
            self._progress.reset(self._current, total=steps, description=what, visible=True)
        shown = f"  loss {loss:.3f}" if loss else ""
        self._progress.update(self._current, completed=step + 1, total=steps, loss=shown)

    def run(self, record: StudyRecord, is_new: bool) -> None:
        """Note a finished run; its line is printed if this process did it."""
        self._done += 1
        self._progress.update(self._all, completed=self._done)
        self._progress.update(self._current, visible=False)
        self._waits_for = ""
        if is_new:
            self._console.print(
                f"{self._done}/{self._runs}  {describe_run(record)}", markup=False, soft_wrap=True
            )

    def wait(self, who: str) -> None:
        """Say once who does what is left."""
        if who != self._waits_for:
            self._waits_for = who
            self._console.print(
                f"waiting for {who}, which does what is left", markup=False, soft_wrap=True
            )


def describe_run(record: StudyRecord) -> str:
    """One run in one line, shares in per cent."""
    scores = record.scores
    shown = [
        f"OA {100 * scores.overall_accuracy:.2f}",
        f"mIoU {100 * scores.mean_iou:.2f}",
        *(f"{name} IoU {100 * scores.iou[name]:.2f}" for name in ("bolt",) if name in scores.iou),
        f"{record.steps} steps",
        f"{record.cpu_s / 60:.1f} min of one core",
    ]
    return f"{record.run}: {', '.join(shown)}"
