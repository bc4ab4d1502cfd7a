"""Locate motors from one to four views of one clamping, simulated; one JSON per motor, resumable.

    boltpose synth scenes -n 12 --views 1 --angles 4 --seed 4000 -o runs/several_views/scenes
    python -m boltpose.evaluation.several_views_run

Priors are built from the true labels of the full scans; the masks are those of the shipped scene
network, which has seen other motors of the same factory. Where the motor is hidden they are the
true ones: the network knows no plates before the camera, and the pose is what is asked for.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

import boltpose
from boltpose.arrays import BoolArray, Float32Array, FloatArray
from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.poses import measure_pose_error
from boltpose.evaluation.reman18 import TrueMotor, list_motors, read_motor, read_pixel_labels
from boltpose.evaluation.several_views_cases import Case, Kind, list_cases, make_shots, still_seen
from boltpose.geometry.transforms import Transform
from boltpose.io.atomic import write_atomic
from boltpose.io.scan import read_scan
from boltpose.locate_config import LocateConfig
from boltpose.locate_views import JointConfig, Shot, locate_views
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.schema import LocateResult, Part, Registration
from boltpose.segmentation.models import load_models
from boltpose.segmentation.predictor import ScenePredictor

_log = logging.getLogger(__name__)
FOLDER = "several_views"
_PACKAGE = Path(boltpose.__file__).parent
_SOURCES = (
    "geometry/*.py",
    "registration/*.py",
    "view.py",
    "joint_*.py",
    "locate*.py",
    "placement.py",
    "evaluation/several_views_cases.py",
    "evaluation/several_views_run.py",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRecord:
    """What came of one case; lengths in mm, angles in degrees."""

    kind: str
    views: tuple[int, ...]
    must_be_refused: bool
    is_ok: bool
    failed: tuple[str, ...]
    p_correct: float
    worst_bolt_mm: float | None
    """Of the pose in frame `base`, also of a refused one; None if there was none."""
    worst_axis_deg: float | None
    depth_mm: float | None
    """Error of the motor's centre along the first view's line of sight, signed."""
    beside_mm: float | None
    """The same across it."""
    depth_sigma_mm: float | None
    """Stated for `depth_mm`."""
    bolt_sigmas: tuple[float, ...]
    """Error of every true bolt's place under the pose, in units of the pose's covariance
    (Mahalanobis distance in three dimensions)."""
    views_apart_sigmas: float | None

    @property
    def is_wrong(self) -> bool:
        """A tool sent there would miss a bolt: more than 2 mm or 2 degrees."""
        return self.worst_bolt_mm is None or (
            self.worst_bolt_mm > 2.0 or (self.worst_axis_deg or 0.0) > 2.0
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingRecord:
    """All cases of one motor in one clamp."""

    fingerprint: str
    motor: str
    family: str
    views_apart_deg: float
    """Largest angle between two lines of sight."""
    cases: tuple[CaseRecord, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Folders:
    """Where what is needed lies and where what is measured goes."""

    scenes: Path
    priors: Path
    out: Path


class _Remembered:
    """A scene predictor that does not look at the same points twice."""

    def __init__(self, predictor: ScenePredictor) -> None:
        self._predictor = predictor
        self._known: dict[str, Float32Array] = {}

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        points = np.ascontiguousarray(points_camera)
        key = hashlib.sha256(points.tobytes()).hexdigest()
        if key not in self._known:
            self._known[key] = self._predictor.predict(points)
        return self._known[key]


class _Truth:
    """A scene predictor that knows which points are on the motor."""

    def __init__(self, shots: Sequence[Shot], masks: Sequence[BoolArray]) -> None:
        pairs = zip(shots, masks, strict=True)
        self._tree = KDTree(np.concatenate([shot.scan.points[mask] for shot, mask in pairs]))

    def predict(self, points_camera: npt.ArrayLike) -> Float32Array:
        distance, _ = self._tree.query(points_camera, distance_upper_bound=1e-6)
        return np.isfinite(distance).astype(np.float32)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", type=Path, default=Path("runs/several_views/scenes"))
    parser.add_argument("--priors", type=Path, default=Path("runs/several_views/priors"))
    parser.add_argument("-o", "--output", type=Path, default=Path("results") / FOLDER)
    parser.add_argument("--motors", nargs="*", help="only these")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    folders = Folders(scenes=given.scenes, priors=given.priors, out=given.output)
    measure_several_views(folders, motors=given.motors)


def measure_several_views(folders: Folders, *, motors: Sequence[str] | None = None) -> None:
    """Measure every motor that has no record of this source yet.

    Args:
        folders: Data, priors (built where missing) and records.
        motors: Only these; None for all.

    Raises:
        InputFileError: A file of the data set is missing.
    """
    mark = _fingerprint()
    predictor = load_models(None).scene
    for name in list_motors(folders.scenes):
        path = folders.out / f"{name}.json"
        if (motors is not None and name not in motors) or _mark_of(path) == mark:
            continue
        record = _measure(folders, read_motor(folders.scenes, name), _Remembered(predictor), mark)
        _write(path, record)
        _log.info("%s", name)


def read_clampings(folder: Path) -> tuple[ClampingRecord, ...]:
    """Read all records of a folder, by name; none if it is missing or empty.

    Raises:
        InputFileError: A file holds something else.
    """
    return tuple(_read(path) for path in sorted(folder.glob("motor_*.json")))


def _measure(
    folders: Folders, motor: TrueMotor, predictor: ScenePredictor, mark: str
) -> ClampingRecord:
    prepared = _prepared(folders, motor)
    shots: list[Shot] = []
    masks: list[BoolArray] = []
    for view in motor.views:
        scan = read_scan(view.depth_path, camera=view.depth_path.parents[1] / "scene_camera.json")
        if scan.pixels is None:
            raise InputFileError(view.depth_path, "a scan without pixels", "a depth image")
        shots.append(Shot(scan=scan, base_from_camera=view.base_from_camera))
        masks.append(read_pixel_labels(view, scan.pixels) != Part.BACKGROUND)
    cases: list[CaseRecord] = []
    for case in list_cases(len(shots)):
        chosen = make_shots(case, shots, masks, motor.number)
        used: ScenePredictor = predictor
        if case.kind is Kind.HIDDEN:
            pairs = zip(case.views, chosen, strict=True)
            seen = [still_seen(shots[view], shot, masks[view]) for view, shot in pairs]
            used = _Truth(chosen, seen)
        result = locate_views(chosen, prepared, used)
        cases.append(_record(case, result, motor, prepared))
    axes = np.array([view.base_from_camera.z_axis for view in motor.views])
    return ClampingRecord(
        fingerprint=mark,
        motor=motor.name,
        family=motor.family,
        views_apart_deg=float(np.degrees(np.arccos(np.clip(axes @ axes.T, -1, 1)).max())),
        cases=tuple(cases),
    )


def _prepared(folders: Folders, motor: TrueMotor) -> PreparedPrior:
    path = folders.priors / f"{motor.name}.prior.npz"
    if not path.exists():
        prior = build_prior(
            read_scan(motor.scan_path), config=BuildConfig(use_file_labels=True), name=motor.name
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        write_prior(path, prior)
    return prepare_prior(read_prior(path))


def _record(
    case: Case, result: LocateResult, motor: TrueMotor, prepared: PreparedPrior
) -> CaseRecord:
    verdict = result.verdict
    first = motor.views[case.views[0]]
    truth = first.base_from_camera @ first.camera_from_prior
    worst_mm = worst_deg = depth = beside = sigma = None
    bolt_sigmas: tuple[float, ...] = ()
    if result.registration is not None and result.base_from_camera is not None:
        found = result.base_from_camera @ result.registration.camera_from_prior
        error = measure_pose_error(found, truth, motor.bolts)
        worst_mm, worst_deg = error.worst_bolt_mm, float(np.degrees(error.worst_axis_rad))
        centre = truth.apply(prepared.centre_mm)
        sight = centre - first.base_from_camera.translation_mm
        sight /= np.linalg.norm(sight)
        offset = found.apply(prepared.centre_mm) - centre
        depth = float(offset @ sight)
        beside = float(np.linalg.norm(offset - depth * sight))
        turn = np.kron(np.eye(2), result.base_from_camera.rotation)
        covariance = turn @ result.registration.covariance @ turn.T
        sigma = float(np.sqrt(sight @ covariance[3:, 3:] @ sight))
        bolt_sigmas = _bolt_sigmas(result.registration, result.base_from_camera, truth, motor)
    return CaseRecord(
        kind=str(case.kind),
        views=case.views,
        must_be_refused=case.must_be_refused,
        is_ok=result.is_ok,
        failed=tuple(str(check) for check in verdict.failed),
        p_correct=verdict.p_correct,
        worst_bolt_mm=worst_mm,
        worst_axis_deg=worst_deg,
        depth_mm=depth,
        beside_mm=beside,
        depth_sigma_mm=sigma,
        bolt_sigmas=bolt_sigmas,
        views_apart_sigmas=verdict.scores.get("views_apart_sigmas"),
    )


def _bolt_sigmas(
    registration: Registration, base_from_camera: Transform, truth: Transform, motor: TrueMotor
) -> tuple[float, ...]:
    """The pose's own part: the prior's errors are in no view."""
    camera_from_base = base_from_camera.inverse()
    tops = np.array([bolt.head_top_mm for bolt in motor.bolts])
    found = registration.camera_from_prior.apply(tops)
    errors: FloatArray = found - (camera_from_base @ truth).apply(tops)
    sigmas: list[float] = []
    for place, error in zip(found, errors, strict=True):
        x, y, z = place - registration.centre_mm
        jacobian = np.hstack([np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]]), np.eye(3)])
        covariance = jacobian @ registration.covariance @ jacobian.T
        sigmas.append(float(np.sqrt(error @ np.linalg.solve(covariance, error))))
    return tuple(sigmas)


def _write(path: Path, record: ClampingRecord) -> None:
    text = json.dumps(encode(record), indent=1) + "\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, write)


def _read(path: Path) -> ClampingRecord:
    try:
        return decode(ClampingRecord, json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record of several_views_run") from error


def _mark_of(path: Path) -> str | None:
    try:
        return _read(path).fingerprint
    except InputFileError:
        return None


def _fingerprint() -> str:
    """Hash what the numbers follow from; data, priors and networks are taken as frozen."""
    digest = hashlib.sha256(f"{LocateConfig()} {JointConfig()}".encode())
    for pattern in _SOURCES:
        for path in sorted(_PACKAGE.glob(pattern)):
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


if __name__ == "__main__":
    main()
