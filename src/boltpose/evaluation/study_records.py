"""What one run of the study gave, as it stands in `results/study/`."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.study_settings import RunSettings
from boltpose.io.atomic import write_atomic

FORMAT = "boltpose.study/1"
LOSS_POINTS = 40
"""Losses kept of a run: means over equal stretches of steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyScores:
    """How well the points of the test motors, pooled, are labelled."""

    overall_accuracy: float
    mean_iou: float
    """Mean over the classes that occur."""
    iou: Mapping[str, float]
    """Per class that occurs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LossPoint:
    """Loss of a stretch of training."""

    step: int
    """Last step of the stretch, from 1."""
    loss: float
    """Mean over the stretch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEnvironment:
    """Where and with what a run was made."""

    commit: str
    machine: str
    versions: Mapping[str, str]
    """By package."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyRecord:
    """One run, done."""

    format: str
    run: str
    fold: str
    settings: RunSettings
    classes: tuple[str, ...]
    confusion: tuple[tuple[int, ...], ...]
    """Points by true class (row) and given class (column)."""
    scores: StudyScores
    parameters: int
    """Numbers the network learned."""
    steps: int
    losses: tuple[LossPoint, ...]
    cpu_s: float
    """Processor seconds of training and scoring, all attempts."""
    pretraining_cpu_s: float | None
    """The same of the pretraining, which the splits share; None without."""
    environment: StudyEnvironment


def score_study(confusion: Sequence[Sequence[int]], classes: Sequence[str]) -> StudyScores:
    """Scores of a confusion matrix, true classes in rows.

    Raises:
        ValueError: It counts no point, or its shape is not that of the classes.
    """
    counts = np.array(confusion, dtype=np.int64)
    if counts.shape != (len(classes), len(classes)) or counts.sum() == 0:
        raise ValueError(
            f"confusion must count points of {len(classes)} classes, got {counts.shape} with "
            f"{counts.sum()} points"
        )
    hits = np.diag(counts)
    unions = counts.sum(axis=0) + counts.sum(axis=1) - hits
    iou = {
        name: round(float(hit / union), 6)
        for name, hit, union in zip(classes, hits, unions, strict=True)
        if union
    }
    return StudyScores(
        overall_accuracy=round(float(hits.sum() / counts.sum()), 6),
        mean_iou=round(float(np.mean(list(iou.values()))), 6),
        iou=iou,
    )


def thin_losses(losses: Sequence[float], points: int = LOSS_POINTS) -> tuple[LossPoint, ...]:
    """Average the losses of all steps over at most `points` equal stretches."""
    if not losses:
        return ()
    edges = np.unique(np.linspace(0, len(losses), min(points, len(losses)) + 1).round())
    return tuple(
        LossPoint(step=int(end), loss=round(float(np.mean(losses[int(start) : int(end)])), 5))
        for start, end in itertools.pairwise(edges)
    )


def record_path(folder: Path, run: str) -> Path:
    """File of a run's record."""
    return folder / f"{run}.json"


def write_study_record(folder: Path, record: StudyRecord) -> Path:
    """Write a record, one line per field; the file appears whole or not at all."""
    lines = [f" {json.dumps(name)}: {json.dumps(value)}" for name, value in encode(record).items()]
    text = "{\n" + ",\n".join(lines) + "\n}\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    path = record_path(folder, record.run)
    write_atomic(path, write)
    return path


def read_study_record(path: Path) -> StudyRecord:
    """Read a record.

    Raises:
        InputFileError: The file is missing, broken, or of another format.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(data, dict) and "format" in data and data["format"] != FORMAT:
            raise InputFileError(path, f"format {data['format']}", FORMAT)
        return decode(StudyRecord, data)
    except InputFileError:
        raise
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record of boltpose reproduce") from error


def read_study_records(folder: Path) -> tuple[StudyRecord, ...]:
    """Read all records of a folder, by name; none if there is no folder.

    Raises:
        InputFileError: A record cannot be read.
    """
    return tuple(read_study_record(path) for path in sorted(folder.glob("*.json")))
