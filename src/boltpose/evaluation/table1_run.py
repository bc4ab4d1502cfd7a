"""The paper's table 1 again, with the true error beside every fit: one JSON file per motor.

`boltpose reproduce table1` runs it. Global registration by FPFH and FGR, then the paper's ICP
steps, all by Open3D, on the views of reman18 (simulated) under their true masks; what is compared
is registration, not segmentation. Started at the same pose all six methods differ by their steps.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode, encode
from boltpose.evaluation.poses import measure_pose_error
from boltpose.evaluation.reman18 import (
    TrueMotor,
    TrueView,
    list_motors,
    read_motor,
    read_pixel_labels,
)
from boltpose.geometry.normals import estimate_normals, orient_towards
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.io.atomic import write_atomic
from boltpose.io.scan import read_scan
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.config import PaperConfig
from boltpose.registration.grid import thin_with_normals
from boltpose.registration.open3d_features import (
    FeatureCloud,
    compute_features,
    match_globally,
    require_open3d,
)
from boltpose.schema import Prior

FORMAT = "boltpose.table1/1"
FOLDER = "table1"
CHAINS_MM: tuple[tuple[float, ...], ...] = ((10.0,), (10.0, 1.0), (10.0, 1.0, 0.1))
"""Largest pair distances of the steps, as in the paper's rows."""
CURVE_MM: tuple[float, ...] = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Where the fit of poses that do not move is asked for."""
_OFF_MM, _OFF_DEG = 3.0, 3.0
"""How far the deliberately wrong pose is off."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class IcpFit:
    """One view registered by one method."""

    is_point_to_plane: bool
    distances_mm: tuple[float, ...]
    rmse_mm: float
    """Open3D's `inlier_rmse` of the last step: the paper's column."""
    matched: float
    """Share of the scan's points with a partner in it."""
    wall_s: float
    """Global registration and all steps: the paper's column."""
    worst_bolt_mm: float
    """True error."""
    rotation_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StillFit:
    """How well a pose seems to fit, by the pair distance, without moving it."""

    kind: str
    """`true`, or `off`: 3 mm along the axis and 3 degrees about it beside the truth."""
    rmse_mm: tuple[float, ...]
    """One per `CURVE_MM`."""
    matched: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table1View:
    """One view."""

    view: int
    global_worst_bolt_mm: float
    """True error of global registration alone."""
    fits: tuple[IcpFit, ...]
    still: tuple[StillFit, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table1Motor:
    """All views of one motor."""

    format: str
    motor: str
    views: tuple[Table1View, ...]


def run_table1(
    data: Path,
    priors: Path,
    out: Path,
    *,
    motors: Sequence[str] | None = None,
    on_motor: Callable[[str, int, int], None] = lambda name, done, count: None,
) -> None:
    """Measure every motor that has no record yet.

    Args:
        data: Folder of reman18.
        priors: Full scans with normals (priors by true labels) are kept here.
        out: Folder of the records.
        motors: Only these; None for all.
        on_motor: Told every motor that is done, how many are, and of how many.

    Raises:
        MissingExtraError: Open3D is not installed.
        InputFileError: A file of the data set is missing.
    """
    require_open3d()
    out.mkdir(parents=True, exist_ok=True)
    priors.mkdir(parents=True, exist_ok=True)
    wanted = list(motors or list_motors(data))
    for number, name in enumerate(wanted):
        path = out / f"{name}.json"
        if not path.exists():
            truth = read_motor(data, name)
            prior = _prior_of(truth, priors)
            record = Table1Motor(
                format=FORMAT,
                motor=name,
                views=tuple(measure_view(truth, view, prior) for view in truth.views),
            )
            _write(path, record)
        on_motor(name, number + 1, len(wanted))


def measure_view(truth: TrueMotor, view: TrueView, prior: Prior) -> Table1View:
    """Register one view by all six methods, from one global registration.

    Args:
        truth: The motor.
        view: The view.
        prior: Its full scan with normals.
    """
    config = PaperConfig()
    scan = read_scan(view.depth_path)
    if scan.pixels is None:
        raise InputFileError(view.depth_path, "no pixels", "a depth image")
    points = scan.points[read_pixel_labels(view, scan.pixels) > 0]
    began = time.perf_counter()
    start = _register_globally(prior, points, config)
    global_s = time.perf_counter() - began
    o3d = require_open3d()
    source = o3d.geometry.PointCloud(
        o3d.utility.Vector3dVector(voxel_downsample(points, config.icp_voxel_mm))
    )
    target = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(prior.points))
    target.normals = o3d.utility.Vector3dVector(prior.normals)
    fits = [
        _run_chain(source, target, start, chain, is_plane, global_s, truth, view)
        for is_plane in (False, True)
        for chain in CHAINS_MM
    ]
    axis = truth.prior_from_motor.z_axis
    turn = Rotation.from_rotvec(np.radians(_OFF_DEG) * axis).as_matrix()
    centre = prior.points.mean(axis=0)
    off = view.camera_from_prior @ Transform.from_parts(
        "prior", "prior", turn, centre - turn @ centre + _OFF_MM * axis
    )
    still = [
        _fit_still(kind, source, target, pose)
        for kind, pose in (("true", view.camera_from_prior), ("off", off))
    ]
    error = measure_pose_error(start, view.camera_from_prior, truth.bolts)
    return Table1View(
        view=view.index,
        global_worst_bolt_mm=error.worst_bolt_mm,
        fits=tuple(fits),
        still=tuple(still),
    )


def _register_globally(prior: Prior, points: FloatArray, config: PaperConfig) -> Transform:
    scan = voxel_downsample(points, config.voxel_mm)
    normals = orient_towards(scan, estimate_normals(scan, config.normal_neighbours), np.zeros(3))
    features = compute_features(scan, normals, config.feature_radius_mm)
    known = _features_of(prior, config)
    return match_globally(known, features, config.match_distance_mm, config.seed)


def _features_of(prior: Prior, config: PaperConfig) -> FeatureCloud:
    points, normals = thin_with_normals(prior.points, prior.normals, config.voxel_mm)
    return compute_features(points, normals, config.feature_radius_mm)


def _run_chain(
    source: Any,
    target: Any,
    start: Transform,
    chain: tuple[float, ...],
    is_plane: bool,
    global_s: float,
    truth: TrueMotor,
    view: TrueView,
) -> IcpFit:
    registration = require_open3d().pipelines.registration
    method = (
        registration.TransformationEstimationPointToPlane()
        if is_plane
        else registration.TransformationEstimationPointToPoint()
    )
    began = time.perf_counter()
    matrix = start.inverse().matrix
    result: Any = None
    for distance in chain:
        result = registration.registration_icp(source, target, distance, matrix, method)
        matrix = np.asarray(result.transformation)
    wall_s = time.perf_counter() - began
    pose = _as_pose(matrix)
    error = measure_pose_error(pose, view.camera_from_prior, truth.bolts)
    return IcpFit(
        is_point_to_plane=is_plane,
        distances_mm=chain,
        rmse_mm=float(result.inlier_rmse),
        matched=float(result.fitness),
        wall_s=global_s + wall_s,
        worst_bolt_mm=error.worst_bolt_mm,
        rotation_deg=float(np.degrees(error.rotation_rad)),
    )


def _as_pose(prior_from_camera: FloatArray) -> Transform:
    """Make a rigid transform of Open3D's matrix, whose rotation is off by rounding."""
    left, _, right = np.linalg.svd(prior_from_camera[:3, :3])
    return Transform.from_parts("prior", "camera", left @ right, prior_from_camera[:3, 3]).inverse()


def _fit_still(kind: str, source: Any, target: Any, pose: Transform) -> StillFit:
    registration = require_open3d().pipelines.registration
    fits = [
        registration.evaluate_registration(source, target, distance, pose.inverse().matrix)
        for distance in CURVE_MM
    ]
    return StillFit(
        kind=kind,
        rmse_mm=tuple(float(fit.inlier_rmse) for fit in fits),
        matched=tuple(float(fit.fitness) for fit in fits),
    )


def _prior_of(truth: TrueMotor, priors: Path) -> Prior:
    path = priors / f"{truth.name}.prior.npz"
    if not path.exists():
        config = BuildConfig(use_file_labels=True)
        scan = read_scan(truth.scan_path)
        write_prior(path, build_prior(scan, config=config, name=truth.name))
    return read_prior(path)


def _write(path: Path, record: Table1Motor) -> None:
    text = (json.dumps(encode(record), allow_nan=False) + "\n").encode()

    def write(stream: BinaryIO) -> None:
        stream.write(text)

    write_atomic(path, write)


def read_table1(folder: Path) -> tuple[Table1Motor, ...]:
    """Read all records of a folder, by motor; none if there is no such folder.

    Raises:
        InputFileError: A record cannot be read.
    """
    records: list[Table1Motor] = []
    for path in sorted(folder.glob("motor_*.json")):
        try:
            record = decode(Table1Motor, json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError) as error:
            raise InputFileError(path, str(error), "a record of `reproduce table1`") from error
        if record.format != FORMAT:
            raise InputFileError(path, f"format {record.format}", FORMAT)
        records.append(record)
    return tuple(records)
