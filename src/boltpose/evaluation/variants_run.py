"""Which motor is clamped? All views of reman18 against folders of 18 to 144 priors; resumable.

    boltpose synth motors -n 126 --seed 3000 -o runs/variants/motors
    python -m boltpose.evaluation.variants_run --factory runs/variants/motors

The views' masks and the priors of reman18 come from networks that have seen no motor of the
family; the other priors from the factory's labelled scans.
"""

from __future__ import annotations

import argparse
import hashlib
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.arrays import Float32Array
from boltpose.errors import ConfigError, InputFileError
from boltpose.evaluation.poses import measure_pose_error
from boltpose.evaluation.reman18 import TrueMotor, TrueView, list_motors, read_motor
from boltpose.evaluation.run import leave_out_folder
from boltpose.evaluation.variants_records import (
    FORMAT,
    VariantCase,
    VariantMotor,
    read_variant_motor,
    write_variant_motor,
)
from boltpose.io.scan import read_scan
from boltpose.locate import locate
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import read_prior, read_sketch, write_prior
from boltpose.prior.sketch import PriorSketch
from boltpose.registration.library import PriorLibrary
from boltpose.schema import LocateResult, Prior, Scan
from boltpose.segmentation.models import load_models
from boltpose.segmentation.predictor import ScenePredictor
from boltpose.variants import locate_variant

_log = logging.getLogger(__name__)
SIZES = (18, 36, 72, 144)
"""Priors to choose from; beyond the 18 of reman18 motors of the factory."""
_PACKAGE = Path(boltpose.__file__).parent
_SOURCES = (
    "geometry/*.py",
    "registration/*.py",
    "prior/*.py",
    "segmentation/*.py",
    "view.py",
    "locate*.py",
    "variant*.py",
    "evaluation/variants_run.py",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantRequest:
    """What is to be measured, from what."""

    reman18: Path
    factory: Path
    models: Path
    priors: Path
    out: Path
    sizes: tuple[int, ...] = SIZES
    views: tuple[int, ...] | None = None


class RememberingPredictor:
    """Segments a view once, however often it is asked, and tells what that cost."""

    def __init__(self, predictor: ScenePredictor) -> None:
        self._predictor = predictor
        self._digest = b""
        self._answer: Float32Array = np.zeros(0, dtype=np.float32)
        self.cpu_s = 0.0
        """Of the segmentation of the view at hand."""
        self.is_remembered = False
        """Whether the last answer came from memory."""

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        """See `ScenePredictor.predict`."""
        points = np.ascontiguousarray(points_camera)
        digest = hashlib.blake2b(points.tobytes()).digest()
        self.is_remembered = digest == self._digest
        if not self.is_remembered:
            start = time.process_time()
            self._answer = self._predictor.predict(points)
            self.cpu_s = time.process_time() - start
            self._digest = digest
        return self._answer


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--factory", type=Path, required=True, help="labelled full scans")
    parser.add_argument("--models", type=Path, default=Path("data/models"))
    parser.add_argument("--priors", type=Path, default=Path("runs/variants/priors"))
    parser.add_argument("-o", "--output", type=Path, default=Path("results/variants"))
    parser.add_argument("--motors", nargs="*", help="only these")
    parser.add_argument("--views", type=int, nargs="*", help="only these")
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    request = VariantRequest(
        reman18=given.data,
        factory=given.factory,
        models=leave_out_folder(given.models),
        priors=given.priors,
        out=given.output,
        sizes=tuple(given.sizes),
        views=None if given.views is None else tuple(given.views),
    )
    measure_variants(request, motors=given.motors)


def measure_variants(request: VariantRequest, *, motors: Sequence[str] | None = None) -> None:
    """Measure every motor that has no record of this source and request yet.

    Args:
        request: What to measure. Priors that `request.priors` lacks are built into it.
        motors: Only these; None for all.

    Raises:
        ConfigError: The factory has too few motors for the sizes.
        InputFileError: A file of the data sets is missing.
    """
    truth = [read_motor(request.reman18, name) for name in list_motors(request.reman18)]
    mark = _fingerprint(request)
    request.out.mkdir(parents=True, exist_ok=True)
    request.priors.mkdir(parents=True, exist_ok=True)
    with threadpool_limits(limits=1, user_api="blas"):
        paths = [_prior_of(motor, request) for motor in truth]
        paths += _factory_priors(request, max(request.sizes) - len(truth))
        sketches = [read_sketch(path) for path in paths]
        for motor in truth:
            target = request.out / f"{motor.name}.json"
            if (motors is not None and motor.name not in motors) or _is_current(target, mark):
                continue
            cases = _Measurement(motor, paths, sketches, request).run()
            record = VariantMotor(
                format=FORMAT, fingerprint=mark, motor=motor.name, family=motor.family, cases=cases
            )
            write_variant_motor(target, record)
            right = sum(record.is_right(case) for case in cases)
            wrong = sum(record.is_wrong(case) for case in cases)
            _log.info("%s: %d cases, %d right, %d wrong", motor.name, len(cases), right, wrong)


class _Measurement:
    """All cases of one motor."""

    def __init__(
        self,
        motor: TrueMotor,
        paths: Sequence[Path],
        sketches: Sequence[PriorSketch],
        request: VariantRequest,
    ) -> None:
        self._motor = motor
        self._request = request
        self._paths = {sketch.name: path for sketch, path in zip(sketches, paths, strict=True)}
        self._libraries: dict[tuple[int, bool], PriorLibrary] = {}
        for size in request.sizes:
            some = sketches[:size]
            self._libraries[size, True] = PriorLibrary(some, self._read)
            others = [sketch for sketch in some if sketch.name != motor.name]
            self._libraries[size, False] = PriorLibrary(others, self._read)
        models = load_models(request.models / motor.family)
        self._predictor = RememberingPredictor(models.scene)

    def run(self) -> tuple[VariantCase, ...]:
        """Measure every folder in the first view, some in all.

        In all views: the smallest folder, and the largest if the motor is in it.
        """
        cases: list[VariantCase] = []
        for view in self._motor.views:
            if self._request.views is not None and view.index not in self._request.views:
                continue
            scan = read_scan(view.depth_path)
            one_s = self._time_one_prior(scan, view)
            for (size, is_known), library in self._libraries.items():
                sizes = self._request.sizes
                is_whole = size == min(sizes) or (is_known and size == max(sizes))
                if is_whole or view is self._motor.views[0]:
                    cases.append(self._measure(view, scan, library, is_known, one_s))
        return tuple(cases)

    def _read(self, name: str) -> Prior:
        return read_prior(self._paths[name])

    def _time_one_prior(self, scan: Scan, view: TrueView) -> float:
        # the first call starts the session of the network: not what is measured
        self._predictor.predict(scan.points[:5000])
        start = time.process_time()
        prior = self._read(self._motor.name)
        locate(scan, prior, view.base_from_camera, self._predictor)
        return time.process_time() - start

    def _measure(
        self, view: TrueView, scan: Scan, library: PriorLibrary, is_known: bool, one_s: float
    ) -> VariantCase:
        library.forget()
        start = time.process_time()
        result = locate_variant(scan, library, view.base_from_camera, self._predictor)
        cpu_s = time.process_time() - start
        if self._predictor.is_remembered:
            cpu_s += self._predictor.cpu_s
        library.forget()  # there are eight of them
        search = result.provenance["variants"]
        return VariantCase(
            view=view.index,
            priors=len(library),
            is_known=is_known,
            named=result.prior_name,
            status=result.verdict.status,
            failed=tuple(str(check) for check in result.verdict.failed),
            reasons=result.verdict.reasons,
            agreements={v.name: v.score for v in result.variants if np.isfinite(v.score)},
            registered=tuple(search["registered"]),
            worst_bolt_mm=self._worst_bolt_mm(result, view),
            cpu_s=cpu_s,
            one_prior_cpu_s=one_s,
        )

    def _worst_bolt_mm(self, result: LocateResult, view: TrueView) -> float | None:
        if not result.is_ok or result.registration is None:
            return None
        if result.prior_name != self._motor.name:
            return None
        pose = result.registration.camera_from_prior
        return measure_pose_error(pose, view.camera_from_prior, self._motor.bolts).worst_bolt_mm


def _prior_of(motor: TrueMotor, request: VariantRequest) -> Path:
    path = request.priors / f"{motor.name}.prior.npz"
    if not path.exists():
        scan = read_scan(motor.scan_path)
        # the labels in the file are the truth: nothing may look at them
        scan = Scan(points=scan.points, source=scan.source)
        models = load_models(request.models / motor.family)
        write_prior(path, build_prior(scan, models.parts, name=motor.name))
    return path


def _factory_priors(request: VariantRequest, count: int) -> list[Path]:
    if count <= 0:
        return []
    names = list_motors(request.factory)
    if len(names) < count:
        raise ConfigError(f"{request.factory} holds {len(names)} motors, wanted {count}")
    paths: list[Path] = []
    for name in names[:count]:
        called = name.replace("motor_", "factory_")
        path = request.priors / f"{called}.prior.npz"
        if not path.exists():
            scan = read_scan(request.factory / name / "prior.ply")
            config = BuildConfig(use_file_labels=True)
            write_prior(path, build_prior(scan, config=config, name=called))
        paths.append(path)
    return paths


def _fingerprint(request: VariantRequest) -> str:
    digest = hashlib.sha256(f"{FORMAT} {request.sizes} {request.views}".encode())
    for pattern in _SOURCES:
        for path in sorted(_PACKAGE.glob(pattern)):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _is_current(path: Path, mark: str) -> bool:
    try:
        return read_variant_motor(path).fingerprint == mark
    except InputFileError:
        return False


if __name__ == "__main__":
    main()
