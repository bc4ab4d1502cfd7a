"""Make the samples of a data set that are missing, by one process or many."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from threadpoolctl import threadpool_limits

from boltpose.errors import BoltposeError, ConfigError
from boltpose.synthesis.folder import locked, open_folder
from boltpose.synthesis.settings import DataSetSettings
from boltpose.synthesis.write import (
    Sample,
    finished_samples,
    remove_unfinished,
    sample_name,
    write_sample,
)

MakeSample = Callable[[DataSetSettings, int], Sample]
"""Makes one sample from nothing but the settings and its number; importable by name."""
Task = Callable[[int], Sample]
RunTasks = Callable[[Task, Sequence[int]], Generator[Sample]]
"""Runs a task for every number, anywhere, and yields each result once, in any order."""

MAX_SAMPLES = 100_000
"""Five digits in the names."""
_SAMPLES_PER_PROCESS = 100
"""A worker is replaced after so many: memory that a library kept is given back."""


class WorkerDiedError(BoltposeError, RuntimeError):
    """A worker process ended without a result."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one run has done."""

    made: int
    kept: int
    """Samples that were there already."""
    retries: int
    """Draws that could not be built and were drawn again."""


def run_data_set(
    root: Path,
    settings: DataSetSettings,
    count: int,
    make: MakeSample,
    run_tasks: RunTasks,
    *,
    on_start: Callable[[int, int], None] = lambda kept, missing: None,
    on_sample: Callable[[Sample], None] = lambda sample: None,
) -> Run:
    """Make the missing samples of a data set.

    The process that calls this does all the writing, so samples appear whole wherever they were
    computed, and a data set is the same bytes whoever computed it.

    Args:
        root: Folder of the data set; made if missing.
        settings: What is to be made.
        count: How many samples there shall be.
        make: Makes one.
        run_tasks: Runs many: `run_local`, or the one of `synthesis.cluster`.
        on_start: Called once with the samples kept and missing.
        on_sample: Called with every new sample after it is written.

    Returns:
        What was done.

    Raises:
        ConfigError: `count` is out of range, or the folder was begun with other settings.
        InputFileError: The folder holds something else, or another run is at work there.
        WorkerDiedError: A worker ended without a result, for example for want of memory.
        KeyboardInterrupt: Passed on; the folder then holds whole samples only.
    """
    if not 1 <= count <= MAX_SAMPLES:
        raise ConfigError(f"the number of motors must be 1 to {MAX_SAMPLES}, got {count}")
    open_folder(root, settings)
    with locked(root):
        remove_unfinished(root)
        done = finished_samples(root)
        missing = [number for number in range(count) if sample_name(number) not in done]
        on_start(count - len(missing), len(missing))
        retries = 0
        # closed at once when something fails here, so that no worker goes on for nothing
        with closing(run_tasks(partial(make, settings), missing)) as samples:
            for sample in samples:
                write_sample(root, sample)
                retries += len(sample.retries)
                on_sample(sample)
    return Run(made=len(missing), kept=count - len(missing), retries=retries)


def run_local(task: Task, numbers: Sequence[int], *, workers: int = 1) -> Generator[Sample]:
    """Run a task for every number on this machine.

    Args:
        task: Importable by name where `workers` > 1.
        numbers: What to make.
        workers: Processes; 1 computes in this one.

    Yields:
        Every sample once; with several workers in the order they end.

    Raises:
        ConfigError: `workers` < 1.
        WorkerDiedError: A worker ended without a result.
    """
    if workers < 1:
        raise ConfigError(f"workers must be >= 1, got {workers}")
    if workers == 1:
        for number in numbers:
            yield run_single_threaded(task, number)
        return
    yield from _run_processes(task, numbers, workers)


def _run_processes(task: Task, numbers: Sequence[int], workers: int) -> Generator[Sample]:
    # spawn: a fork copies locks that threads of numerical libraries may hold
    pool = ProcessPoolExecutor(
        max_workers=min(workers, max(1, len(numbers))),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        max_tasks_per_child=_SAMPLES_PER_PROCESS,
    )
    waiting = iter(numbers)
    running: set[Future[Sample]] = set()
    try:
        while True:
            # few at a time: results wait in memory until they are written
            while len(running) < 2 * workers and (number := next(waiting, None)) is not None:
                running.add(pool.submit(run_single_threaded, task, number))
            if not running:
                return
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BrokenProcessPool as error:
        raise WorkerDiedError(
            "a worker process died, perhaps for want of memory; finished motors are kept: "
            "run the command again, with fewer --workers"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _start_worker() -> None:
    # Ctrl-C reaches every process of a terminal: workers end at once and without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def run_single_threaded(task: Task, number: int) -> Sample:
    """Run a task with one thread for linear algebra: the processes share the cores."""
    with threadpool_limits(limits=1):
        return task(number)
