"""One view's way from points to a judged pose and its bolts: the steps that all callers share."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import DegenerateGeometryError, FrameError
from boltpose.geometry.sampling import canonical_rows
from boltpose.geometry.transforms import Transform
from boltpose.locate_config import LocateConfig
from boltpose.registration.icp import refine_pose
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.register import RegistrationResult, register
from boltpose.registration.relabel import near_prior
from boltpose.registration.scene import Scene, build_scene
from boltpose.schema import Registration, Scan
from boltpose.segmentation.predictor import ScenePredictor


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class View:
    """A scan as registration and verdict see it; the same for every order of its points."""

    scan: Scan
    points: FloatArray
    """Shape (N, 3), mm, frame `camera`: chosen from the scan, in canonical order."""
    is_motor: BoolArray
    """Shape (N,): what the network takes for the motor."""
    scene: Scene

    @property
    def motor_points(self) -> FloatArray:
        """Shape (M, 3): the points taken for the motor."""
        return self.points[self.is_motor]


def see(scan: Scan, predictor: ScenePredictor, config: LocateConfig) -> View:
    """Choose points of a scan and tell the motor from its surroundings.

    Args:
        scan: One view, mm, frame `camera`.
        predictor: Scene segmentation.
        config: Settings.

    Returns:
        The view. Where there are too few points to register, none is taken for the motor.
    """
    points = scan.points[canonical_rows(scan.points, config.max_points)]
    if len(points) < config.registration.min_points:
        is_motor = np.zeros(len(points), dtype=np.bool_)
    else:
        is_motor = np.asarray(predictor.predict(points) >= config.min_motor_probability)
    return View(scan=scan, points=points, is_motor=is_motor, scene=build_scene(points))


def register_view(view: View, prepared: PreparedPrior, config: LocateConfig) -> RegistrationResult:
    """Find candidate poses of a prior in a view, best first."""
    return register(prepared, view.motor_points, config.registration, scene=view.scene)


def register_again(
    best: Registration, view: View, prepared: PreparedPrior, config: LocateConfig
) -> Registration:
    """Refine a pose on the points that the pose itself says belong to the motor.

    The last resolution of the fine stage does both: it pairs no point that is not on the prior.
    """
    if config.relabel_mm == 0 or config.registration.method != "multi_start":
        return best
    near = near_prior(prepared, best.camera_from_prior, view.points, threshold_mm=config.relabel_mm)
    fine_config = config.registration.fine
    fine_config = replace(fine_config, steps=fine_config.steps[-1:])
    try:
        fine = refine_pose(best.camera_from_prior, view.points[near], prepared, fine_config)
    except DegenerateGeometryError:
        return best  # too few points near the prior: the verdict will say so
    return replace(
        best,
        camera_from_prior=fine.camera_from_prior,
        converged=fine.converged,
        rms_mm=fine.rms_mm,
        inlier_ratio=fine.inlier_ratio,
        covariance=fine.covariance,
        centre_mm=fine.centre_mm,
    )


def points_around(
    scan: Scan, camera_from_prior: Transform, prepared: PreparedPrior, config: LocateConfig
) -> FloatArray:
    """Scan points in the box around the posed motor, (N, 3), mm, frame `camera`.

    Most of a scan is clamp and table: it is sorted out before anything is computed on it.
    """
    middle = camera_from_prior.apply(prepared.centre_mm)
    reach = prepared.radius_mm + 1.0
    near = np.ones(len(scan), dtype=np.bool_)
    for column, centre in zip(scan.points.T, middle, strict=True):
        near &= np.abs(column - centre) < reach
    points = scan.points[near]
    return points[canonical_rows(points, config.max_near_points)]


def frame_of_result(base_from_camera: Transform | None) -> str:
    """Name the frame that bolts are given in: `base`, or `camera` without a hand-eye.

    Raises:
        FrameError: The hand-eye does not map `camera` to `base`.
    """
    if base_from_camera is None:
        return "camera"
    if (base_from_camera.target, base_from_camera.source) != ("base", "camera"):
        raise FrameError(
            f"hand-eye must be base_from_camera, got "
            f"{base_from_camera.target}_from_{base_from_camera.source}"
        )
    return "base"
