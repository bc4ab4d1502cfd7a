"""What is kept of every hard case, compactly, and the folder it is kept in."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, BinaryIO

from boltpose.errors import InputFileError
from boltpose.io.atomic import write_atomic
from boltpose.registration.evidence import Evidence

FORMAT = "boltpose.hard_cases/1"
WRONG_MM = 2.0
"""A bolt farther off than this makes a pose wrong (issue 5)."""
WRONG_DEG = 2.0
"""So does a turn of the motor by more than this."""
_SCORES = tuple(field.name for field in fields(Evidence))
_DIGITS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class HardCase:
    """One pose of one prior in one scene: what is true of it and what the scan says about it."""

    scene: str
    """What was done to the view, for example `hidden 90 %`."""
    pose: str
    """Where the pose comes from: `located`, or the kind of near miss, raw or refined."""
    size: float
    """mm or degrees by which a near miss was moved; 0 if located."""
    is_settled: bool
    """The pose is the end of a refinement, as every pose that `locate` gives; else it was put
    where it is, or left where a refinement had not ended."""
    view: int
    prior: str
    worst_bolt_mm: float
    """Against the true pose; infinite where no pose is right."""
    rotation_deg: float
    evidence: Evidence | None
    """None if registration found no pose."""

    @property
    def is_wrong(self) -> bool:
        """True if a tool would miss a bolt: accepting this pose is a false accept."""
        return self.worst_bolt_mm > WRONG_MM or self.rotation_deg > WRONG_DEG

    @property
    def is_starved(self) -> bool:
        """True if most of the motor is truly out of sight: there a refusal may well be right."""
        return self.scene.split()[0] in ("hidden", "cut", "dropout")

    @property
    def kind(self) -> str:
        """The group in which the case is counted: the scene, and in ordinary scenes the pose."""
        if self.is_starved:
            return (
                f"{self.scene.split()[0]}: {'located' if self.pose == 'located' else 'near miss'}"
            )
        if self.scene in ("other size", "other family", "mirrored", "motor absent", "two motors"):
            return self.scene
        if self.scene.startswith("wrong unit"):
            return "wrong unit"
        return self.pose


@dataclass(frozen=True, slots=True, kw_only=True)
class HardMotor:
    """All cases of one motor."""

    fingerprint: str
    data_set: str
    """`reman18` or `factory`."""
    motor: str
    family: str
    is_chooser: bool
    """An even family: it chose weights and thresholds. The odd ones test."""
    changes: tuple[tuple[int, tuple[str, ...]], ...]
    """Per view, what happened to the motor after its full scan (factory)."""
    cases: tuple[HardCase, ...]


def write_hard_motor(path: Path, record: HardMotor) -> None:
    """Write a motor's cases, one a line; the file appears whole or not at all."""
    head = {
        "format": FORMAT,
        "fingerprint": record.fingerprint,
        "data_set": record.data_set,
        "motor": record.motor,
        "family": record.family,
        "is_chooser": record.is_chooser,
        "changes": record.changes,
        "columns": [*_case_columns(), *_SCORES],
    }
    lines = [json.dumps(_row(case), separators=(",", ":")) for case in record.cases]
    text = json.dumps(head)[:-1] + ', "cases": [\n' + ",\n".join(lines) + "\n]}\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)


def read_hard_motor(path: Path) -> HardMotor:
    """Read a motor's cases.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        columns = data["columns"]
        record = HardMotor(
            fingerprint=str(data["fingerprint"]),
            data_set=str(data["data_set"]),
            motor=str(data["motor"]),
            family=str(data["family"]),
            is_chooser=bool(data["is_chooser"]),
            changes=tuple((int(view), tuple(names)) for view, names in data["changes"]),
            cases=tuple(_case(row) for row in data["cases"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputFileError(path, str(error), "cases written by hard_run") from error
    if columns != [*_case_columns(), *_SCORES]:
        raise InputFileError(path, f"the columns {columns}", "those of today's evidence")
    return record


def read_hard_motors(folder: Path) -> tuple[HardMotor, ...]:
    """Read all motors of a folder, by file name; none if the folder is missing or empty."""
    return tuple(read_hard_motor(path) for path in sorted(folder.glob("*_motor_*.json")))


def _case_columns() -> list[str]:
    return [field.name for field in fields(HardCase) if field.name != "evidence"]


def _row(case: HardCase) -> list[Any]:
    row: list[Any] = [_as_json(getattr(case, name)) for name in _case_columns()]
    if case.evidence is None:
        return row
    return row + [_as_json(getattr(case.evidence, name)) for name in _SCORES]


def _as_json(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    return value


def _case(row: Sequence[Any]) -> HardCase:
    columns = _case_columns()
    values = dict(zip(columns, row[: len(columns)], strict=True))
    scores = row[len(columns) :]
    evidence = None
    if scores:
        found: dict[str, Any] = {
            name: math.nan if value is None else value
            for name, value in zip(_SCORES, scores, strict=True)
        }
        evidence = Evidence(**found)
    for name in ("worst_bolt_mm", "rotation_deg"):
        values[name] = math.inf if values[name] is None else float(values[name])
    return HardCase(**values, evidence=evidence)
