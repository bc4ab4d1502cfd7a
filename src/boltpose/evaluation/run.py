"""The leave-one-family-out evaluation on reman18: one JSON file per motor, resumable."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from threadpoolctl import threadpool_limits

from boltpose.errors import ConfigError, InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.fingerprint import fingerprint
from boltpose.evaluation.motor import MotorEvaluation
from boltpose.evaluation.pipeline import Pipeline
from boltpose.evaluation.records import FORMAT, MotorRecord
from boltpose.evaluation.reman18 import list_motors, read_motor
from boltpose.io.atomic import write_atomic

Item = TypeVar("Item")

LEAVE_OUT = "leave_family_out"
"""Folder of the networks below `models_dir`, one folder per family that they have not seen."""


def evaluate(
    data: str | Path,
    models_dir: str | Path,
    out: str | Path,
    *,
    motors: Sequence[str] | None = None,
    views: Sequence[int] | None = None,
    resume: bool = True,
    with_negatives: bool = True,
    pipeline: Pipeline[Any] | None = None,
    console: Console | None = None,
) -> tuple[MotorRecord, ...]:
    """Build each motor's prior, locate it in its views, and try the must-be-refused set.

    Everything about a motor is done by networks that have seen no motor of its family.

    Args:
        data: Folder of reman18.
        models_dir: Folder with `leave_family_out/FAMILY/`, or that folder itself.
        out: Folder for `motor_XXX.json`; made if missing.
        motors: Which motors; None for all.
        views: Which views; None for all. Records of some views are told apart from full ones.
        resume: Keep records in `out` that the same source, networks and request made.
        with_negatives: Whether to run the must-be-refused set.
        pipeline: What is evaluated; None for `boltpose_pipeline()`, the one users call.
        console: Where progress is shown; None for nowhere.

    Returns:
        The records of the motors asked for, in the order of the data set.

    Raises:
        ConfigError: A motor or view is not in the data set.
        InputFileError: A file of the data set or a family's networks are missing.
    """
    chain = pipeline or shipped_pipeline()
    root, folder, target = Path(data), leave_out_folder(Path(models_dir)), Path(out)
    truth = {name: read_motor(root, name) for name in list_motors(root)}
    chosen = choose(motors, list(truth), "motor")
    known_views = sorted({view.index for motor in truth.values() for view in motor.views})
    chosen_views = None if views is None else choose(views, known_views, "view")
    request = (f"views {chosen_views}", f"negatives {with_negatives}", FORMAT)
    mark = fingerprint(root, folder, request)
    target.mkdir(parents=True, exist_ok=True)

    # two sets of networks at once: the motor's own and that of a foreign scene
    @lru_cache(maxsize=2)
    def models_of(family: str) -> Any:
        return chain.load_models(_family_folder(folder, family))

    records: list[MotorRecord] = []
    with threadpool_limits(limits=1, user_api="blas"), show_progress(console, len(chosen)) as step:
        for name in chosen:
            path = target / f"{name}.json"
            record = _read_if_current(path, mark) if resume else None
            if record is None:
                evaluation = MotorEvaluation(
                    chain, models_of, truth[name], truth, lambda text, n=name: step(n, text)
                )
                record = evaluation.run(mark, views=chosen_views, with_negatives=with_negatives)
                write_record(path, record)
            step(name, None)
            records.append(record)
    return tuple(records)


def write_record(path: Path, record: MotorRecord) -> None:
    """Write a record as JSON; the file appears whole or not at all."""
    text = (json.dumps(encode(record), indent=1, allow_nan=False) + "\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(path, write)


def read_record(path: str | Path) -> MotorRecord:
    """Read a record.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        record = decode(MotorRecord, json.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record written by evaluate") from error
    if record.format != FORMAT:
        raise InputFileError(path, f"format {record.format}", FORMAT)
    return record


def read_records(folder: str | Path) -> tuple[MotorRecord, ...]:
    """Read all records of a folder, by motor.

    Raises:
        InputFileError: There is none, or one cannot be read.
    """
    paths = sorted(Path(folder).glob("motor_*.json"))
    if not paths:
        raise InputFileError(folder, "no motor_*.json", "the folder evaluate wrote to")
    return tuple(read_record(path) for path in paths)


def shipped_pipeline() -> Pipeline[Any]:
    """Return the pipeline users call."""
    # here, not on top: reading records and writing reports needs no ONNX Runtime
    from boltpose.evaluation.product import boltpose_pipeline

    return boltpose_pipeline()


def _read_if_current(path: Path, mark: str) -> MotorRecord | None:
    if not path.exists():
        return None
    try:
        record = read_record(path)
    except InputFileError:
        return None  # of an older format: measured again
    return record if record.fingerprint == mark else None


def choose(asked: Sequence[Item] | None, known: list[Item], what: str) -> list[Item]:
    """Keep what was asked for, in the order it is known; None asks for all.

    Raises:
        ConfigError: Something asked for is not known.
    """
    if asked is None:
        return known
    unknown = [item for item in asked if item not in known]
    if unknown:
        raise ConfigError(f"{what} {unknown} is not in the data set, there are {known}")
    return [item for item in known if item in asked]


def leave_out_folder(models_dir: Path) -> Path:
    """Return the folder with one folder of networks per family left out."""
    nested = models_dir / LEAVE_OUT
    return nested if nested.is_dir() else models_dir


def _family_folder(folder: Path, family: str) -> Path:
    path = folder / family
    if not path.is_dir():
        raise InputFileError(path, "nothing", "networks that have not seen this family")
    return path


@contextmanager
def show_progress(
    console: Console | None, total: int
) -> Generator[Callable[[str, str | None], None]]:
    """Yield a function to call with a motor and its step; None as step: the motor is done."""
    if console is None:
        yield lambda _motor, _step: None
        return
    bar = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} motors"),
        TimeElapsedColumn(),
        console=console,
        disable=not console.is_terminal,
    )
    with bar:
        task = bar.add_task("evaluate", total=total)

        def step(motor: str, text: str | None) -> None:
            if text is None:
                bar.advance(task)
            else:
                bar.update(task, description=f"{motor}: {text}")

        yield step
