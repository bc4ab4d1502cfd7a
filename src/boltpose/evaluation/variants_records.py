"""What is kept of the evaluation of many priors: one JSON file per clamped motor."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.io.atomic import write_atomic
from boltpose.schema import Status

FORMAT = "boltpose.variants/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantCase:
    """One view with so many priors to choose from."""

    view: int
    priors: int
    is_known: bool
    """False: the clamped motor's prior was left out, and every motor found is a wrong one."""
    named: str
    """The motor found, or the nearest one when refused."""
    status: Status
    failed: tuple[str, ...]
    reasons: tuple[str, ...]
    agreements: Mapping[str, float]
    """Of every prior compared, by name, 0 to 1."""
    registered: tuple[str, ...]
    """Priors registered in full, in this order."""
    worst_bolt_mm: float | None
    """Of the pose, where the right motor was found."""
    cpu_s: float
    """Of the whole call, files of the priors read, segmentation included."""
    one_prior_cpu_s: float
    """Of `locate` with the right prior on the same view, its file read and prepared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantMotor:
    """All cases of one clamped motor."""

    format: str
    fingerprint: str
    motor: str
    family: str
    cases: tuple[VariantCase, ...]

    def is_right(self, case: VariantCase) -> bool:
        """Ok, and it is this motor."""
        return case.status is Status.OK and case.is_known and case.named == self.motor

    def is_wrong(self, case: VariantCase) -> bool:
        """Ok, and it is not this motor: the worst thing."""
        return case.status is Status.OK and not self.is_right(case)


def write_variant_motor(path: Path, record: VariantMotor) -> None:
    """Write a record as JSON; the file appears whole or not at all."""
    text = (json.dumps(encode(record), indent=1, allow_nan=False) + "\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(path, write)


def read_variant_motor(path: Path) -> VariantMotor:
    """Read a record.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        record = decode(VariantMotor, json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record written by variants_run") from error
    if record.format != FORMAT:
        raise InputFileError(path, f"format {record.format}", FORMAT)
    return record


def read_variant_motors(folder: Path) -> tuple[VariantMotor, ...]:
    """Read all records of a folder, by motor; none if there is no such folder.

    Raises:
        InputFileError: A record cannot be read.
    """
    return tuple(read_variant_motor(path) for path in sorted(folder.glob("motor_*.json")))
