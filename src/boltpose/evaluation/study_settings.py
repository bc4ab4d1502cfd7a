"""All that a run of the study follows from, as it stands in its record."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import encode


@dataclass(frozen=True, slots=True, kw_only=True)
class DataMark:
    """Which data set it is, wherever it lies."""

    motors: int
    digest: str
    """12 hexadecimal digits over names and sizes of all files of motors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """All that one training follows from, besides the code."""

    task: str
    backbone: str
    inputs: str
    points: int
    batch: int
    epochs: float
    warm_up_epochs: float
    points_per_epoch: int
    learning_rate: float
    use_bfloat16: bool
    seed: int
    data: DataMark
    motors: tuple[str, ...] | None
    """Trained on; None for all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """All that one run of the study follows from."""

    training: TrainingSettings
    pretraining: TrainingSettings | None
    test: tuple[str, ...]
    passes: int


def mark_data(root: Path) -> DataMark:
    """Recognise a data set by the names and sizes of its motors' files.

    Raises:
        InputFileError: There is no motor in the folder.
    """
    files = sorted(path for path in root.glob("motor_*/**/*") if path.is_file())
    if not files:
        raise InputFileError(root, "no motor_*/ with files", "a folder of labelled motors")
    digest = hashlib.sha256()
    for path in files:
        digest.update(f"{path.relative_to(root).as_posix()} {path.stat().st_size}\0".encode())
    motors = len({path.relative_to(root).parts[0] for path in files})
    return DataMark(motors=motors, digest=digest.hexdigest()[:12])


def digest_of(settings: TrainingSettings | RunSettings) -> str:
    """8 hexadecimal digits that differ when settings differ; names folders of networks."""
    text = json.dumps(encode(settings), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:8]
