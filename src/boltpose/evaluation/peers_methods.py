"""The methods that are compared: each prepares a prior once and then finds it in motor points.

Every coarse method of others is refined by the same three point-to-plane steps of the paper
(`PaperConfig`, Open3D), so that they differ by where they start. FPFH is set up as in FINDINGS,
section 1: normals by Open3D from two voxels, turned outward (prior) and to the camera (scan),
except in the row that follows Open3D's tutorial to the letter. Distances are explicit and in mm:
the defaults of small_gicp and KISS-Matcher are for metres.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import MissingExtraError
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.registration.coarse import register_coarsely
from boltpose.registration.config import PaperConfig, RegistrationConfig
from boltpose.registration.open3d_features import (
    FeatureCloud,
    match_globally,
    require_open3d,
)
from boltpose.registration.prepare import PreparedPrior

OURS = "ours"
_PAPER = PaperConfig()
_PPF_STEP = 0.05
"""Of the model's size: OpenCV's own default and that of its sample."""
_GICP_VOXEL_MM = 1.0
_GICP_STEPS_MM = (3.0, 1.0)
"""The pair distances of our own fine stage."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PeerPose:
    """What a method found."""

    camera_from_prior: Transform
    is_claimed: bool = True
    """False where the method itself says that the pose is not valid or not converged."""


@dataclass(frozen=True, slots=True, eq=False)
class PeerSteps:
    """The two halves of a method."""

    prepare: Callable[[PreparedPrior], Any]
    """Once per prior; not timed."""
    find: Callable[[Any, PreparedPrior, FloatArray], PeerPose | None]
    """Model, prior and motor points, (N, 3), mm, frame `camera`; None where it finds nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Peer:
    """One method."""

    name: str
    """In files and on the command line."""
    title: str
    """In the report."""
    package: str
    """What it comes from, as pip calls it."""
    steps: PeerSteps
    uses_ours: bool = False
    """It starts where our coarse stage ends."""


def package_version(package: str) -> str:
    """Return the version of an installed package, `boltpose` included.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise MissingExtraError(package, "bench") from error


def _require(module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except (ImportError, OSError) as error:
        raise MissingExtraError(package, "bench") from error


def _as_pose(matrix: FloatArray, *, is_inverse: bool) -> Transform:
    """Make `camera_from_prior` of a (4, 4) whose rotation is off by rounding."""
    left, _, right = np.linalg.svd(matrix[:3, :3])
    if is_inverse:
        pose = Transform.from_parts("prior", "camera", left @ right, matrix[:3, 3])
        return pose.inverse()
    return Transform.from_parts("camera", "prior", left @ right, matrix[:3, 3])


def _o3d_cloud(points: FloatArray) -> Any:
    # a copy: Open3D takes no read-only arrays
    o3d = require_open3d()
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points)))


def _thin_with_normals(points: FloatArray, voxel_mm: float) -> Any:
    """Thin and estimate normals as Open3D's tutorial does, which leaves their signs to chance."""
    cloud = _o3d_cloud(points).voxel_down_sample(voxel_mm)
    near = require_open3d().geometry.KDTreeSearchParamHybrid(radius=2 * voxel_mm, max_nn=30)
    cloud.estimate_normals(near)
    return cloud


def _describe(cloud: Any, voxel_mm: float) -> FeatureCloud:
    o3d = require_open3d()
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel_mm, max_nn=100)
    return FeatureCloud(cloud, o3d.pipelines.registration.compute_fpfh_feature(cloud, search))


def _prior_features(prepared: PreparedPrior, voxel_mm: float) -> FeatureCloud:
    """Describe a prior with its normals turned outward."""
    o3d = require_open3d()
    cloud = _thin_with_normals(prepared.points, voxel_mm)
    normals = np.asarray(cloud.normals)
    _, nearest = prepared.tree.query(np.asarray(cloud.points))
    is_inward = np.einsum("ni,ni->n", normals, prepared.normals[nearest]) < 0
    cloud.normals = o3d.utility.Vector3dVector(np.where(is_inward[:, None], -normals, normals))
    return _describe(cloud, voxel_mm)


def _scan_features(points: FloatArray, voxel_mm: float) -> FeatureCloud:
    """Describe a scan with its normals turned to the camera."""
    cloud = _thin_with_normals(points, voxel_mm)
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    return _describe(cloud, voxel_mm)


@dataclass(frozen=True, slots=True, eq=False)
class _Refinable:
    """What a coarse method knows of a prior, and the target of the ICP steps that follow."""

    model: Any
    target: Any


def _refined(
    prepare: Callable[[PreparedPrior], Any],
    start: Callable[[Any, FloatArray], PeerPose | None],
) -> PeerSteps:
    """Let the paper's three ICP steps of Open3D, point to plane, follow a coarse method."""

    def prepare_both(prepared: PreparedPrior) -> _Refinable:
        target = _o3d_cloud(prepared.points)
        target.normals = require_open3d().utility.Vector3dVector(np.array(prepared.normals))
        return _Refinable(prepare(prepared), target)

    def find(known: _Refinable, prepared: PreparedPrior, points: FloatArray) -> PeerPose | None:
        found = start(known.model, points)
        if found is None:
            return None
        registration = require_open3d().pipelines.registration
        source = _o3d_cloud(points).voxel_down_sample(_PAPER.icp_voxel_mm)
        matrix = found.camera_from_prior.inverse().matrix
        for distance in _PAPER.icp_distances_mm:
            step = registration.registration_icp(
                source,
                known.target,
                distance,
                matrix,
                registration.TransformationEstimationPointToPlane(),
            )
            matrix = np.asarray(step.transformation)
        return replace(found, camera_from_prior=_as_pose(matrix, is_inverse=True))

    return PeerSteps(prepare_both, find)


def _start_fgr_tutorial(model: Any, points: FloatArray) -> PeerPose:
    scan = _describe(_thin_with_normals(points, _PAPER.voxel_mm), _PAPER.voxel_mm)
    return PeerPose(
        camera_from_prior=match_globally(model, scan, 0.5 * _PAPER.voxel_mm, _PAPER.seed)
    )


def _start_fgr(model: Any, points: FloatArray) -> PeerPose:
    scan = _scan_features(points, _PAPER.voxel_mm)
    return PeerPose(
        camera_from_prior=match_globally(model, scan, _PAPER.match_distance_mm, _PAPER.seed)
    )


def _start_fgr_tuned(model: Any, points: FloatArray) -> PeerPose:
    o3d = require_open3d()
    registration = o3d.pipelines.registration
    scan = _scan_features(points, _PAPER.voxel_mm)
    o3d.utility.random.seed(_PAPER.seed)
    option = registration.FastGlobalRegistrationOption(
        maximum_correspondence_distance=_PAPER.match_distance_mm,
        decrease_mu=True,
        iteration_number=128,
    )
    result = registration.registration_fgr_based_on_feature_matching(
        scan.cloud, model.cloud, scan.features, model.features, option
    )
    return PeerPose(camera_from_prior=_as_pose(np.asarray(result.transformation), is_inverse=True))


def _start_ransac(model: Any, points: FloatArray) -> PeerPose:
    o3d = require_open3d()
    registration = o3d.pipelines.registration
    scan = _scan_features(points, 4.0)
    o3d.utility.random.seed(_PAPER.seed)
    reach_mm = 6.0  # 1.5 voxels, with its checks and criteria as in Open3D's tutorial
    result = registration.registration_ransac_based_on_feature_matching(
        scan.cloud,
        model.cloud,
        scan.features,
        model.features,
        True,
        reach_mm,
        registration.TransformationEstimationPointToPoint(False),
        3,
        [
            registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            registration.CorrespondenceCheckerBasedOnDistance(reach_mm),
        ],
        registration.RANSACConvergenceCriteria(100_000, 0.999),
    )
    return PeerPose(camera_from_prior=_as_pose(np.asarray(result.transformation), is_inverse=True))


def _prepare_kiss(prepared: PreparedPrior) -> Any:
    _require("kiss_matcher", "kiss-matcher")
    return list(prepared.points.astype(np.float32))


def _start_kiss(model: Any, points: FloatArray) -> PeerPose | None:
    package = _require("kiss_matcher", "kiss-matcher")
    # without the clamping, which is for metres
    config = package.KISSMatcherConfig(voxel_size=3.0, enable_noise_bound_clamping=False)
    found = package.KISSMatcher(config).estimate(list(points.astype(np.float32)), model)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = found.rotation, np.ravel(found.translation)
    if not np.isfinite(matrix).all():
        return None
    return PeerPose(
        camera_from_prior=_as_pose(matrix, is_inverse=True), is_claimed=bool(found.valid)
    )


def _prepare_gicp(prepared: PreparedPrior) -> Any:
    package = _require("small_gicp", "small-gicp")
    return package.preprocess_points(prepared.points, _GICP_VOXEL_MM, 20, 1)


def _gicp(kind: str) -> Callable[[Any, PreparedPrior, FloatArray], PeerPose | None]:
    def find(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose | None:
        package = _require("small_gicp", "small-gicp")
        coarse = register_coarsely(
            prepared, voxel_downsample(points, 2.0), RegistrationConfig().coarse
        )
        starts = coarse.poses[:1].transforms()
        if not starts:
            return None
        source, _ = package.preprocess_points(points, _GICP_VOXEL_MM, 20, 1)
        target, tree = model
        matrix = starts[0].inverse().matrix
        is_converged = False
        for distance_mm in _GICP_STEPS_MM:
            result = package.align(
                target,
                source,
                tree,
                init_T_target_source=matrix,
                registration_type=kind,
                max_correspondence_distance=distance_mm,
                num_threads=1,
                max_iterations=50,
                rotation_epsilon=1e-5,
                translation_epsilon=1e-3,
            )
            matrix, is_converged = np.asarray(result.T_target_source), bool(result.converged)
        return PeerPose(
            camera_from_prior=_as_pose(matrix, is_inverse=True), is_claimed=is_converged
        )

    return find


def _prepare_ppf(prepared: PreparedPrior) -> Any:
    cv2 = _require("cv2", "opencv-contrib-python-headless")
    model = np.hstack([prepared.coarse_points, prepared.coarse_normals]).astype(np.float32)
    detector = cv2.ppf_match_3d_PPF3DDetector(_PPF_STEP, _PPF_STEP, 30)
    detector.trainModel(model)
    return detector, model


def _start_ppf(model: Any, points: FloatArray) -> PeerPose | None:
    cv2 = _require("cv2", "opencv-contrib-python-headless")
    detector, known = model
    cloud = _thin_with_normals(points, 2.0)
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    scene = np.hstack([np.asarray(cloud.points), np.asarray(cloud.normals)]).astype(np.float32)
    found = detector.match(scene, 1 / 5, _PPF_STEP)
    if not found:
        return None
    # as OpenCV's sample does, which keeps two: the best five by votes, refined by its own ICP
    icp = cv2.ppf_match_3d_ICP(100, 0.005, 2.5, 8)
    _, refined = icp.registerModelToScene(known, scene, list(found[:5]))
    best = min(refined, key=lambda pose: float(pose.residual))
    matrix = np.asarray(best.pose, dtype=np.float64)
    if not np.isfinite(matrix).all():
        return None
    return PeerPose(camera_from_prior=_as_pose(matrix, is_inverse=False))


_TUTORIAL = _refined(
    lambda prepared: _describe(
        _thin_with_normals(prepared.points, _PAPER.voxel_mm), _PAPER.voxel_mm
    ),
    _start_fgr_tutorial,
)
_FGR = _refined(lambda prepared: _prior_features(prepared, _PAPER.voxel_mm), _start_fgr)
_FGR_TUNED = _refined(lambda prepared: _prior_features(prepared, _PAPER.voxel_mm), _start_fgr_tuned)
_RANSAC = _refined(lambda prepared: _prior_features(prepared, 4.0), _start_ransac)
_KISS = _refined(_prepare_kiss, _start_kiss)
_PPF = _refined(_prepare_ppf, _start_ppf)
_GICP = PeerSteps(_prepare_gicp, _gicp("GICP"))
_PLANE_ICP = PeerSteps(_prepare_gicp, _gicp("PLANE_ICP"))

PEERS: tuple[Peer, ...] = (
    Peer("fgr_tutorial", "Open3D FPFH + FGR, tutorial", "open3d", _TUTORIAL),
    Peer("fgr", "Open3D FPFH + FGR, normals turned outward", "open3d", _FGR),
    Peer("fgr_tuned", "the same, `decrease_mu`, 128 iterations", "open3d", _FGR_TUNED),
    Peer("ransac", "Open3D FPFH + RANSAC, 4 mm, mutual", "open3d", _RANSAC),
    Peer("kiss", "KISS-Matcher, 3 mm", "kiss-matcher", _KISS),
    Peer("ppf", "OpenCV surface_matching, PPF", "opencv-contrib-python-headless", _PPF),
    Peer("gicp", "our coarse stage + small_gicp GICP", "small-gicp", _GICP, uses_ours=True),
    Peer(
        "plane_icp",
        "our coarse stage + small_gicp PLANE_ICP",
        "small-gicp",
        _PLANE_ICP,
        uses_ours=True,
    ),
)
"""All but ours, which `peers_run` calls as `locate` does."""
METHODS: tuple[str, ...] = (*(peer.name for peer in PEERS), OURS)
