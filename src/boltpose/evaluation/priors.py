"""How bolts are found with given networks, views left out: quick, and for any labelled scans."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from rich.console import Console
from threadpoolctl import threadpool_limits

from boltpose.errors import InputFileError
from boltpose.evaluation.bolts import BoltMatch
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.fingerprint import describe_environment, fingerprint
from boltpose.evaluation.motor import MotorEvaluation
from boltpose.evaluation.pipeline import Pipeline
from boltpose.evaluation.records import Environment, PriorRecord
from boltpose.evaluation.reman18 import list_motors, read_motor
from boltpose.evaluation.run import choose, leave_out_folder, shipped_pipeline, show_progress
from boltpose.io.atomic import write_atomic
from boltpose.schema import Prior
from boltpose.segmentation.reliability import Reliability, measure_reliability

PRIORS_FORMAT = "boltpose.priors/1"
RIGHT_MM = 0.5
"""A bolt is rightly placed up to this lateral error: what a socket forgives, and issue 2's bound
on sure bolts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedBolt:
    """What a prior says of one of its bolts, and whether it is so."""

    found_id: str
    confidence: float
    is_sure: bool
    is_right: bool
    """It is a bolt, on its right side, and at most `RIGHT_MM` beside its true axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorPrior:
    """The prior of one motor against the truth."""

    motor: str
    family: str
    true_bolts: int
    prior: PriorRecord
    stated: tuple[StatedBolt, ...]
    """One per bolt of the prior, matched or not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorsRecord:
    """The priors of a data set's motors, as they stand in a JSON file."""

    format: str
    fingerprint: str
    data: str
    networks: str
    """Folder of the networks."""
    is_leave_out: bool
    """Every motor's networks had not seen its family; else one folder served all."""
    motors: tuple[MotorPrior, ...]
    environment: Environment


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorScores:
    """Counts over all motors."""

    true_bolts: int
    found: int
    """True bolts that a bolt of the prior stands for."""
    false: int
    """Bolts of the priors that are none."""
    wrong_side: int
    sure: int
    """True bolts found and marked sure."""
    sure_false: int
    sure_misplaced: int
    """Sure bolts more than `RIGHT_MM` beside their true axis."""
    worst_sure_mm: float
    """Largest lateral error of a sure bolt; 0 without any."""
    without_prior: int
    """Motors no prior could be built for; their bolts count as missed."""

    @property
    def recall(self) -> float:
        """Share of the true bolts that were found."""
        return self.found / self.true_bolts if self.true_bolts else 0.0

    @property
    def precision(self) -> float:
        """Share of the found bolts that are some."""
        return self.found / (self.found + self.false) if self.found else 0.0

    @property
    def sure_share(self) -> float:
        """Share of the true bolts that were found and marked sure."""
        return self.sure / self.true_bolts if self.true_bolts else 0.0


def evaluate_priors(
    data: str | Path,
    networks: str | Path,
    *,
    motors: Sequence[str] | None = None,
    pipeline: Pipeline[Any] | None = None,
    console: Console | None = None,
) -> PriorsRecord:
    """Build the priors of a data set and compare their bolts with the true ones.

    Args:
        data: Folder of reman18, or of motors from `boltpose synth`; views are not looked at.
        networks: Either one folder of networks for all motors, or a folder with
            `leave_family_out/FAMILY/`, or that folder itself.
        motors: Which motors; None for all.
        pipeline: What is evaluated; None for the one users call.
        console: Where progress is shown; None for nowhere.

    Returns:
        The record.

    Raises:
        ConfigError: A motor is not in the data set.
        InputFileError: A file of the data set or a family's networks are missing.
    """
    chain = pipeline or shipped_pipeline()
    root, folder = Path(data), Path(networks)
    is_leave_out = not any(folder.glob("*.onnx"))
    if is_leave_out:
        folder = leave_out_folder(folder)
    known = list(list_motors(root))
    chosen = choose(motors, known, "motor")
    truth = {name: read_motor(root, name, with_views=False) for name in chosen}

    @lru_cache(maxsize=1)
    def models_of(family: str) -> Any:
        place = folder / family if is_leave_out else folder
        if not place.is_dir():
            raise InputFileError(place, "nothing", "networks that have not seen this family")
        return chain.load_models(place)

    found: list[MotorPrior] = []
    with threadpool_limits(limits=1, user_api="blas"), show_progress(console, len(chosen)) as step:
        # by family: networks are loaded once
        for name in sorted(chosen, key=lambda name: (truth[name].family, name)):
            evaluation = MotorEvaluation(
                chain,
                models_of if is_leave_out else lambda _family: models_of(""),
                truth[name],
                truth,
                lambda text, n=name: step(n, text),
            )
            prior, record = evaluation.build_prior()
            found.append(
                MotorPrior(
                    motor=name,
                    family=truth[name].family,
                    true_bolts=len(truth[name].bolts),
                    prior=record,
                    stated=() if prior is None else _state(prior, record),
                )
            )
            step(name, None)
    return PriorsRecord(
        format=PRIORS_FORMAT,
        fingerprint=fingerprint(root, folder, ("priors", PRIORS_FORMAT)),
        data=root.as_posix(),
        networks=folder.as_posix(),
        is_leave_out=is_leave_out,
        motors=tuple(sorted(found, key=lambda motor: motor.motor)),
        environment=describe_environment(),
    )


def score_priors(record: PriorsRecord) -> PriorScores:
    """Count what was found, missed and made up."""
    matches = [match for motor in record.motors for match in motor.prior.bolts.matches]
    false = [bolt for motor in record.motors for bolt in motor.prior.bolts.false]
    sure = [match for match in matches if match.is_sure]
    return PriorScores(
        true_bolts=sum(motor.true_bolts for motor in record.motors),
        found=len(matches),
        false=len(false),
        wrong_side=sum(not match.is_side_right for match in matches),
        sure=len(sure),
        sure_false=sum(bolt.is_sure for bolt in false),
        sure_misplaced=sum(match.error.lateral_mm > RIGHT_MM for match in sure),
        worst_sure_mm=max((match.error.lateral_mm for match in sure), default=0.0),
        without_prior=sum(bool(motor.prior.problem) for motor in record.motors),
    )


def confidence_reliability(record: PriorsRecord) -> Reliability | None:
    """Hold the bolts' stated confidence against what they are; None without any bolt."""
    stated = [bolt for motor in record.motors for bolt in motor.stated]
    if not stated:
        return None
    return measure_reliability(
        np.array([bolt.confidence for bolt in stated], dtype=np.float64),
        np.array([bolt.is_right for bolt in stated], dtype=np.bool_),
    )


def write_priors(path: str | Path, record: PriorsRecord) -> None:
    """Write the record as JSON; the file appears whole or not at all."""
    text = (json.dumps(encode(record), indent=1, allow_nan=False) + "\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(Path(path), write)


def read_priors(path: str | Path) -> PriorsRecord:
    """Read a record.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        record = decode(PriorsRecord, json.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record of `evaluate --priors-only`") from error
    if record.format != PRIORS_FORMAT:
        raise InputFileError(path, f"format {record.format}", PRIORS_FORMAT)
    return record


def _state(prior: Prior, record: PriorRecord) -> tuple[StatedBolt, ...]:
    match_of: dict[str, BoltMatch] = {match.found_id: match for match in record.bolts.matches}
    stated: list[StatedBolt] = []
    for bolt in prior.bolts:
        match = match_of.get(bolt.id)
        is_right = match is not None and match.is_side_right and match.error.lateral_mm <= RIGHT_MM
        stated.append(
            StatedBolt(
                found_id=bolt.id,
                confidence=bolt.confidence,
                is_sure=bolt.is_sure,
                is_right=is_right,
            )
        )
    return tuple(stated)
