"""What one evaluation run measured of one motor, as it stands in `results/evaluate/`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from boltpose.evaluation.bolts import BoltMatching
from boltpose.evaluation.masks import MaskCounts
from boltpose.evaluation.negatives import CaseKind, Expectation
from boltpose.evaluation.poses import PoseError, PoseRecord

FORMAT = "boltpose.evaluation/2"


@dataclass(frozen=True, slots=True, kw_only=True)
class StageTime:
    """How long one stage of a call took."""

    name: str
    wall_s: float
    cpu_s: float
    """Of the whole process, all threads."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CallTime:
    """How long one call took, stages included."""

    wall_s: float
    cpu_s: float
    stages: tuple[StageTime, ...]

    def stage_s(self, name: str) -> float:
        """Wall time of one stage, 0 where it did not run."""
        return sum(stage.wall_s for stage in self.stages if stage.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorRecord:
    """The prior of one motor, compared with the truth."""

    problem: str
    """Why no prior could be built; empty if one was."""
    scan_points: int
    bolts: BoltMatching
    axis_error_rad: float | None
    """Angle between the found and the true z axis of the motor; pi would be upside down."""
    roll_error_rad: float | None
    """Angle between the found and the true y axis."""
    axis_sigma_rad: float | None
    """1 sigma of the z axis, as the prior states it."""
    time: CallTime


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewRecord:
    """One view of the motor."""

    view: int
    clamp: str
    points: int
    result: PoseRecord
    mask: MaskCounts | None
    """Points on the posed prior against the true labels; None for a refused view."""
    read_s: float
    time: CallTime


class Outcome(StrEnum):
    """What came of a scan of the must-be-refused set."""

    REFUSED = "refused"
    RIGHT = "right"
    """Accepted, and right (crops only)."""
    WRONG = "wrong"
    """Accepted, and there is no such motor or not there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRecord:
    """One scan of the must-be-refused set."""

    kind: CaseKind
    expectation: Expectation
    scene_motor: str
    view: int
    points: int
    outcome: Outcome
    failed: tuple[str, ...]
    reasons: tuple[str, ...]
    scores: Mapping[str, float]
    pose: PoseError | None
    """Where the right motor is in the scan and a candidate pose was found."""
    time: CallTime


@dataclass(frozen=True, slots=True, kw_only=True)
class Environment:
    """Where and with what the numbers were measured."""

    version: str
    commit: str
    python: str
    numpy: str
    machine: str
    cores: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorRecord:
    """Everything measured of one motor."""

    format: str
    fingerprint: str
    """Of the package source, the networks, the data's version and what was asked for."""
    motor: str
    family: str
    true_bolts: int
    true_tilts_rad: tuple[float, ...]
    """Angle of every true bolt axis against the motor's true z axis: how far off they would be
    for a method that knew the motor's axis exactly and gave it to all bolts."""
    prior: PriorRecord
    views: tuple[ViewRecord, ...]
    cases: tuple[CaseRecord, ...]
    peak_memory_mb: float
    """High-water mark of the process when the prior and the views of this motor were done."""
    peak_memory_all_mb: float
    """The same after the must-be-refused set, which keeps several sets of networks loaded."""
    environment: Environment
