"""Measure all hard cases of the verdict; one JSON file per motor, resumable.

    python -m boltpose.evaluation.hard_run --workers 2
    python -m boltpose.evaluation.hard_run --motors motor_000 --views 0 -o /tmp/hard  # a minute

Needs reman18, the networks that left one family out, and a folder of factory motors:
`boltpose synth scenes -n 80 --views 4 -o FOLDER`. Priors are built on the way, or read from
`--priors`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from threadpoolctl import threadpool_limits

import boltpose
from boltpose.errors import InputFileError
from boltpose.evaluation.hard_cases import HardView, list_hard_cases
from boltpose.evaluation.hard_records import HardMotor, read_hard_motor, write_hard_motor
from boltpose.evaluation.hard_scenes import read_scene
from boltpose.evaluation.reman18 import TrueMotor, TrueView, list_motors, read_motor
from boltpose.evaluation.run import leave_out_folder
from boltpose.io.scan import read_scan
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.config import (
    EvidenceConfig,
    PrepareConfig,
    RegistrationConfig,
    SceneConfig,
)
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.segmentation.models import Models, load_models

_log = logging.getLogger(__name__)
PACKAGE = Path(boltpose.__file__).parent
_SOURCES = ("geometry/*.py", "registration/*.py", "view.py", "locate_config.py")
_CASES = ("hard_cases.py", "hard_poses.py", "hard_scenes.py", "hard_run.py")
_DECIDES = frozenset({"verify.py", "probability.py", "probability_config.py", "config.py"})
"""They judge what was measured, and the report asks them anew; settings count by their values."""
FACTORY_MOTORS = 32
"""Two of each of the factory's 16 families."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HardRequest:
    """What is to be measured, from what."""

    reman18: Path
    factory: Path | None
    models: Path
    priors: Path
    out: Path
    views: tuple[int, ...] | None = None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--factory", type=Path, help="folder of factory scenes; none if left out")
    parser.add_argument("--models", type=Path, default=Path("data/models"))
    parser.add_argument("--priors", type=Path, default=Path("runs/priors"))
    parser.add_argument("-o", "--output", type=Path, default=Path("results/verdict"))
    parser.add_argument("--motors", nargs="*", help="only these")
    parser.add_argument("--views", type=int, nargs="*", help="only these")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    request = HardRequest(
        reman18=given.data,
        factory=given.factory,
        models=leave_out_folder(given.models),
        priors=given.priors,
        out=given.output,
        views=None if given.views is None else tuple(given.views),
    )
    measure_hard_cases(request, motors=given.motors, workers=given.workers)


def measure_hard_cases(
    request: HardRequest, *, motors: Sequence[str] | None = None, workers: int = 1
) -> None:
    """Measure every motor that has no record of this source and request yet.

    Args:
        request: What to measure.
        motors: Only these; None for all.
        workers: Processes; the records do not depend on it.

    Raises:
        InputFileError: A file of the data sets is missing.
    """
    wanted = [("reman18", name) for name in list_motors(request.reman18)]
    if request.factory is not None:
        names = list_motors(request.factory)[:FACTORY_MOTORS]
        wanted += [("factory", name) for name in names]
    if motors is not None:
        wanted = [(data_set, name) for data_set, name in wanted if name in motors]
    request.out.mkdir(parents=True, exist_ok=True)
    mark = _fingerprint(request)
    open_ones = [item for item in wanted if _mark_of(record_path(request, *item)) != mark]
    if workers == 1:
        for item in open_ones:
            _measure_motor(request, *item, mark)
        return
    # spawned, not forked: a fork would inherit the threads of ONNX Runtime
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        jobs = [pool.submit(_measure_motor, request, *item, mark) for item in open_ones]
        for job in jobs:
            job.result()


def record_path(request: HardRequest, data_set: str, motor: str) -> Path:
    """Where the cases of a motor are kept."""
    return request.out / f"{data_set}_{motor}.json"


def _measure_motor(request: HardRequest, data_set: str, name: str, mark: str) -> None:
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    root = request.reman18 if data_set == "reman18" else request.factory
    assert root is not None
    known = list_motors(root)
    if data_set == "factory":
        known = known[:FACTORY_MOTORS]
    bench = _Bench(request, data_set, {motor: read_motor(root, motor) for motor in known})
    with threadpool_limits(1, user_api="blas"):
        record = bench.measure(name, mark)
    write_hard_motor(record_path(request, data_set, name), record)
    _log.info("%s %s: %d cases", data_set, name, len(record.cases))


class _Bench:
    """All motors of one data set, with their priors as they are needed."""

    def __init__(self, request: HardRequest, data_set: str, motors: dict[str, TrueMotor]) -> None:
        self._request = request
        self._is_factory = data_set == "factory"
        self._data_set = data_set
        self._motors = motors
        self._families = sorted({motor.family for motor in motors.values()})

    def measure(self, name: str, mark: str) -> HardMotor:
        """Measure every case of a motor."""
        motor = self._motors[name]
        views = self._wanted_views(motor)
        cases = [
            case
            for view in views
            for case in list_hard_cases(
                self._hard_view(motor, view.index),
                is_thorough=view.index % 2 == 0 and not self._is_factory,
            )
        ]
        return HardMotor(
            fingerprint=mark,
            data_set=self._data_set,
            motor=name,
            family=motor.family,
            is_chooser=self._families.index(motor.family) % 2 == 0,
            changes=tuple((view.index, _changes(view)) for view in views),
            cases=tuple(cases),
        )

    def _wanted_views(self, motor: TrueMotor) -> list[TrueView]:
        wanted = self._request.views
        if wanted is not None:
            return [view for view in motor.views if view.index in wanted]
        if not self._is_factory:
            return list(motor.views)
        # every view is clamped anew: the one before which most has changed
        return [max(motor.views, key=lambda view: (len(_changes(view)), -view.index))]

    def _hard_view(self, motor: TrueMotor, index: int) -> HardView:
        view = next(view for view in motor.views if view.index == index)
        family = [m for m in self._motors.values() if m.family == motor.family and m is not motor]
        others = [m for m in self._motors.values() if m.family != motor.family]
        # which one depends on both numbers, so that all are used over the set
        stranger = others[(7 * motor.number + 3 * index) % len(others)]
        neighbour = family[index % len(family)].views[index] if family else None
        network = None if self._is_factory else _models(self._request.models / motor.family).scene
        return HardView(
            number=motor.number + (1000 if self._is_factory else 0),
            view=index,
            scene=read_scene(view),
            true_bolts=motor.bolts,
            prepared=self._prepared(motor),
            prior_from_motor=motor.prior_from_motor,
            other_sizes={other.name: self._prepared(other) for other in family},
            strangers={stranger.name: self._prepared(stranger)},
            neighbour=None if neighbour is None else read_scene(neighbour),
            network=network,
        )

    def _prepared(self, motor: TrueMotor) -> PreparedPrior:
        return _prepared(self._request, self._is_factory, motor.name, motor.family, motor.scan_path)


def _changes(view: TrueView) -> tuple[str, ...]:
    """Kinds of changes between the full scan and a view; reman18 states none."""
    path = view.depth_path.parent.parent / "bolts.json"
    found = json.loads(path.read_text(encoding="utf-8"))[str(view.index)].get("changes", [])
    return tuple(sorted({str(change).split(":")[0] for change in found}))


@lru_cache(maxsize=6)
def _prepared(
    request: HardRequest, is_factory: bool, name: str, family: str, scan_path: Path
) -> PreparedPrior:
    """Prior of a motor: by networks that do not know its family, or by the factory's labels."""
    path = request.priors / f"{name}.prior.npz"
    if not path.exists():
        scan = read_scan(scan_path)
        if is_factory:
            prior = build_prior(scan, config=BuildConfig(use_file_labels=True), name=name)
        else:
            prior = build_prior(scan, _models(request.models / family).parts, name=name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_prior(path, prior)
    return prepare_prior(read_prior(path))


@lru_cache(maxsize=1)
def _models(folder: Path) -> Models:
    return load_models(folder)


def _mark_of(path: Path) -> str | None:
    try:
        return read_hard_motor(path).fingerprint
    except InputFileError:
        return None


def _fingerprint(request: HardRequest) -> str:
    """Hash what the numbers follow from; data sets, networks and priors are taken as frozen."""
    settings = (RegistrationConfig(), EvidenceConfig(), SceneConfig(), PrepareConfig())
    digest = hashlib.sha256(f"{request.views} {settings}".encode())
    paths = [path for pattern in _SOURCES for path in sorted(PACKAGE.glob(pattern))]
    paths += [PACKAGE / "evaluation" / name for name in _CASES]
    for path in paths:
        if path.name not in _DECIDES:
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


if __name__ == "__main__":
    main()
