"""Locate every view of reman18 and keep what is stated of every bolt beside how far it is off.

    python -m boltpose.evaluation.uncertainty_run
    python -m boltpose.evaluation.uncertainty_run --motors motor_000 -o /tmp/uncertainty

One JSON file per motor; a motor whose file is of this source is not measured again. Priors are
read from `--priors`, or built there, by the networks that never saw the motor's family.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.errors import InputFileError
from boltpose.evaluation.bolts import match_bolts
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.fingerprint import fingerprint
from boltpose.evaluation.poses import LocatedBoltRecord, compare_with_truth
from boltpose.evaluation.reman18 import TrueMotor, list_motors, read_motor
from boltpose.evaluation.run import leave_out_folder
from boltpose.io.atomic import write_atomic
from boltpose.io.scan import read_scan
from boltpose.locate import locate
from boltpose.prior.build import build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.prepare import prepare_prior
from boltpose.schema import LocatedBolt, Scan
from boltpose.segmentation.models import Models, load_models
from boltpose.tool_fit import ToolTolerance, tool_fit_probability

FORMAT = "boltpose.uncertainty/2"
FOLDER = "uncertainty"
TOLERANCES_MM = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0)
"""Of the tools that are held against every bolt."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertainBolt:
    """What was stated of one bolt in one view, and what is true."""

    view: int
    bolt: LocatedBoltRecord
    sigmas_across_mm: tuple[float, float]
    """1 sigma beside the axis in the worse and in the better direction. `sigma_lateral_mm`, made
    for a glance, is the worse one; the covariance that a tool is judged by holds both."""
    tool_fits: tuple[float, ...]
    """Stated probability that a tool of every one of `TOLERANCES_MM` fits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertainMotor:
    """All bolts of one motor in all its views."""

    format: str
    fingerprint: str
    motor: str
    family: str
    bolts: tuple[UncertainBolt, ...]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--models", type=Path, default=Path("data/models"))
    parser.add_argument("--priors", type=Path, default=Path("runs/priors"))
    parser.add_argument("-o", "--output", type=Path, default=Path("results") / FOLDER)
    parser.add_argument("--motors", nargs="*", help="only these")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    models = leave_out_folder(given.models)
    mark = fingerprint(given.data, models, [FORMAT])
    given.priors.mkdir(parents=True, exist_ok=True)
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.motors or list_motors(given.data):
        path = given.output / f"{name}.json"
        if path.exists() and read_uncertain_motor(path).fingerprint == mark:
            continue
        truth = read_motor(given.data, name)
        record = measure_motor(truth, load_models(models / truth.family), given.priors, mark)
        write_uncertain_motor(path, record)
        _log.info("%s: %d bolts", name, len(record.bolts))


def measure_motor(truth: TrueMotor, models: Models, priors: Path, mark: str) -> UncertainMotor:
    """Locate all bolts in all views; refused views give none.

    Args:
        truth: The motor.
        models: Networks that never saw its family.
        priors: Folder its prior is read from, or built into.
        mark: Kept as the record's fingerprint.
    """
    path = priors / f"{truth.name}.prior.npz"
    if not path.exists():
        full_scan = Scan(points=read_scan(truth.scan_path).points)
        write_prior(path, build_prior(full_scan, models.parts, name=truth.name))
    prior = read_prior(path)
    prepared = prepare_prior(prior)
    true_id_of = match_bolts(prior.bolts, truth.bolts).true_id_of
    bolts: list[UncertainBolt] = []
    for view in truth.views:
        result = locate(read_scan(view.depth_path), prepared, view.base_from_camera, models.scene)
        located = {bolt.id: bolt for bolt in result.bolts}
        compared = compare_with_truth(result, view, truth.bolts, true_id_of)
        bolts += [
            UncertainBolt(
                view=view.index,
                bolt=record,
                sigmas_across_mm=sigmas_across_mm(located[record.found_id]),
                tool_fits=_tool_fits(located[record.found_id]),
            )
            for record in compared.bolts
        ]
    return UncertainMotor(
        format=FORMAT,
        fingerprint=mark,
        motor=truth.name,
        family=truth.family,
        bolts=tuple(bolts),
    )


def sigmas_across_mm(bolt: LocatedBolt) -> tuple[float, float]:
    """1 sigma beside the axis in the worse and in the better direction."""
    beside = np.eye(3) - np.outer(bolt.axis, bolt.axis)
    # the smallest of the three is that along the axis, which is taken out
    variances = np.linalg.eigvalsh(beside @ bolt.covariance_mm2 @ beside)
    return math.sqrt(variances[2]), math.sqrt(max(variances[1], 0.0))


def _tool_fits(bolt: LocatedBolt) -> tuple[float, ...]:
    """Probabilities given that the bolt is one: these all are."""
    return tuple(
        tool_fit_probability(
            bolt.covariance_mm2,
            bolt.axis,
            # the truth beside is asked for at the head's top: no lever
            0.0,
            bolt.head_height_mm,
            ToolTolerance(lateral_mm=tolerance),
        )
        for tolerance in TOLERANCES_MM
    )


def write_uncertain_motor(path: Path, record: UncertainMotor) -> None:
    """Write a record as JSON; the file appears whole or not at all."""
    text = (json.dumps(encode(record), allow_nan=False) + "\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(path, write)


def read_uncertain_motor(path: Path) -> UncertainMotor:
    """Read a record.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        record = decode(UncertainMotor, json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record written by uncertainty_run") from error
    if record.format != FORMAT:
        raise InputFileError(path, f"format {record.format}", FORMAT)
    return record


def read_uncertain_motors(folder: Path) -> tuple[UncertainMotor, ...]:
    """Read all records of a folder, by motor; none if there is no such folder.

    Raises:
        InputFileError: A record cannot be read.
    """
    return tuple(read_uncertain_motor(path) for path in sorted(folder.glob("motor_*.json")))


if __name__ == "__main__":
    main()
