"""What is kept of the comparison with other registration methods: one JSON file per method."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.poses import PoseError, measure_pose_error
from boltpose.evaluation.records import Environment
from boltpose.evaluation.reman18 import TrueMotor, TrueView
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.io.atomic import write_atomic
from boltpose.schema import Status

FORMAT = "boltpose.peers/1"
FOLDER = "peers"
_FLIP_RAD = math.radians(135.0)
_TILT_RAD = math.radians(20.0)
_ROLL_RAD = math.radians(5.0)


class Mask(StrEnum):
    """Which points are given to every method as the motor's."""

    NETWORK = "network"
    """What a scene network that has seen no motor of the family takes for the motor."""
    CLAMP20 = "clamp20"
    """The true motor points and one patch of the clamp, a fifth of all."""


class Failure(StrEnum):
    """How a pose is wrong, in the motor's frame."""

    RIGHT = "right"
    """Every bolt within 2 mm and 2 degrees."""
    ROLL = "roll"
    """Turned about the axis of the housing by more than 5 degrees."""
    SLIDE = "slide"
    """Moved along it, more than across."""
    FLIP = "flip"
    """End over end."""
    OTHER = "other"
    NO_POSE = "no pose"
    """The method itself said that it found none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What `verify` says of a pose, whoever found it."""

    status: Status
    failed: tuple[str, ...]
    p_correct: float
    cpu_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerCase:
    """One view registered by one method."""

    motor: str
    view: int
    mark: str
    """Hash of what the pose follows from."""
    pose: tuple[float, ...]
    """`camera_from_prior`, the first three rows one after the other; empty if none was found."""
    error: PoseError | None
    """True error; None without a pose."""
    failure: Failure
    fit_mm: float | None
    """Root mean square of the pairs nearer than 0.1 mm: what the paper would report."""
    is_claimed: bool
    """The method calls its own result valid or converged, or has nothing to say."""
    cpu_s: float
    """Of all threads, the prior prepared before."""
    wall_s: float
    judgement: Judgement | None
    """None without a pose."""
    judgement_mark: str
    """Hash of what the judgement follows from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerFile:
    """All views registered by one method under one kind of mask."""

    format: str
    method: str
    mask: Mask
    version: str
    """Of the package that the method comes from."""
    environment: Environment
    cases: tuple[PeerCase, ...]


def classify_failure(found: Transform, motor: TrueMotor, view: TrueView) -> Failure:
    """Say how a pose is wrong.

    Args:
        found: `camera_from_prior`.
        motor: The truth of the motor.
        view: The truth of the view.

    Returns:
        The kind; a roll and a slide at once is a roll.
    """
    if not measure_pose_error(found, view.camera_from_prior, motor.bolts).is_wrong:
        return Failure.RIGHT
    prior_from_motor = motor.prior_from_motor
    # where the motor's own frame goes, seen from the true one
    moved = prior_from_motor.inverse() @ view.camera_from_prior.inverse() @ found @ prior_from_motor
    tilt = math.acos(float(np.clip(moved.rotation[2, 2], -1.0, 1.0)))
    if tilt > _FLIP_RAD:
        return Failure.FLIP
    if tilt > _TILT_RAD:
        return Failure.OTHER
    if rotation_angle_rad(moved.rotation) > _ROLL_RAD:
        roll = abs(math.atan2(moved.rotation[1, 0], moved.rotation[0, 0]))
        return Failure.ROLL if roll > _ROLL_RAD else Failure.OTHER
    shift = moved.translation_mm
    is_along = abs(float(shift[2])) > float(np.linalg.norm(shift[:2]))
    return Failure.SLIDE if is_along else Failure.OTHER


def pose_of(case: PeerCase) -> Transform | None:
    """Return the pose of a case, `camera_from_prior`; None if there is none."""
    if not case.pose:
        return None
    return Transform("camera", "prior", np.vstack([np.reshape(case.pose, (3, 4)), [0, 0, 0, 1]]))


def peer_path(folder: Path, method: str, mask: Mask) -> Path:
    """Where the cases of a method are kept."""
    return folder / f"{mask}_{method}.json"


def write_peer_file(folder: Path, record: PeerFile) -> None:
    """Write a record as JSON, a line per case; the file appears whole or not at all."""
    data = encode(record)
    lines = [json.dumps(case, allow_nan=False) for case in data.pop("cases")]
    head = json.dumps(data, allow_nan=False)[:-1]
    text = (head + ', "cases": [\n' + ",\n".join(lines) + "\n]}\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(peer_path(folder, record.method, record.mask), write)


def read_peer_file(path: Path) -> PeerFile:
    """Read a record.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        record = decode(PeerFile, json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record written by peers_run") from error
    if record.format != FORMAT:
        raise InputFileError(path, f"format {record.format}", FORMAT)
    return record


def read_peer_files(folder: Path, methods: Sequence[str], mask: Mask) -> tuple[PeerFile, ...]:
    """Read the records of some methods, in their order; what was not run is left out.

    Raises:
        InputFileError: A record cannot be read.
    """
    paths = [peer_path(folder, method, mask) for method in methods]
    return tuple(read_peer_file(path) for path in paths if path.exists())
