"""The methods that are compared: each prepares a prior once and then finds it in motor points.

Every coarse method of others is refined by the same three point-to-plane steps of the paper
(`PaperConfig`), so that they differ by where they start. Distances are explicit and in mm: the
defaults of small_gicp and KISS-Matcher are for metres.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import MissingExtraError
from boltpose.geometry.normals import estimate_normals, orient_towards
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.registration.coarse import register_coarsely
from boltpose.registration.config import PaperConfig, RegistrationConfig
from boltpose.registration.grid import thin_with_normals
from boltpose.registration.open3d_features import (
    FeatureCloud,
    compute_features,
    match_globally,
    require_open3d,
)
from boltpose.registration.paper import run_icp
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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Peer:
    """One method."""

    name: str
    """In files and on the command line."""
    title: str
    """In the report."""
    package: str
    """What it comes from, as pip calls it."""
    prepare: Callable[[PreparedPrior], Any]
    """Once per prior; not timed."""
    find: Callable[[Any, PreparedPrior, FloatArray], PeerPose | None]
    """Model, prior and motor points, (N, 3), mm, frame `camera`; None where it finds nothing."""
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


def refine_as_paper(pose: Transform, points: FloatArray, prepared: PreparedPrior) -> Transform:
    """Refine a coarse pose by the paper's three steps, point to plane.

    Args:
        pose: `camera_from_prior`.
        points: Shape (N, 3), mm, frame `camera`.
        prepared: The prior.
    """
    source = voxel_downsample(points, _PAPER.icp_voxel_mm)
    for distance in _PAPER.icp_distances_mm:
        pose = run_icp(
            pose,
            source,
            prepared,
            max_distance_mm=distance,
            iterations=_PAPER.icp_iterations,
            is_point_to_plane=True,
        )
    return pose


def _as_pose(matrix: FloatArray, *, is_inverse: bool) -> Transform:
    """Make `camera_from_prior` of a (4, 4) whose rotation is off by rounding."""
    left, _, right = np.linalg.svd(matrix[:3, :3])
    if is_inverse:
        pose = Transform.from_parts("prior", "camera", left @ right, matrix[:3, 3])
        return pose.inverse()
    return Transform.from_parts("camera", "prior", left @ right, matrix[:3, 3])


def _prior_features(prepared: PreparedPrior, voxel_mm: float) -> FeatureCloud:
    points, normals = thin_with_normals(prepared.points, prepared.normals, voxel_mm)
    return compute_features(points, normals, 5 * voxel_mm)


def _scan_features(points: FloatArray, voxel_mm: float) -> FeatureCloud:
    scan = voxel_downsample(points, voxel_mm)
    normals = orient_towards(scan, estimate_normals(scan, _PAPER.normal_neighbours), np.zeros(3))
    return compute_features(scan, normals, 5 * voxel_mm)


def _tutorial_features(points: FloatArray, voxel_mm: float) -> FeatureCloud:
    """Follow `preprocess_point_cloud` of Open3D's tutorial: nobody turns the normals."""
    o3d = require_open3d()
    # a copy: Open3D takes no read-only arrays
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points)))
    cloud = cloud.voxel_down_sample(voxel_mm)
    near = o3d.geometry.KDTreeSearchParamHybrid(radius=2 * voxel_mm, max_nn=30)
    cloud.estimate_normals(near)
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * voxel_mm, max_nn=100)
    return FeatureCloud(cloud, o3d.pipelines.registration.compute_fpfh_feature(cloud, search))


def _find_fgr_tutorial(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose:
    scan = _tutorial_features(points, _PAPER.voxel_mm)
    start = match_globally(model, scan, 0.5 * _PAPER.voxel_mm, _PAPER.seed)
    return PeerPose(camera_from_prior=refine_as_paper(start, points, prepared))


def _find_fgr(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose:
    scan = _scan_features(points, _PAPER.voxel_mm)
    start = match_globally(model, scan, _PAPER.match_distance_mm, _PAPER.seed)
    return PeerPose(camera_from_prior=refine_as_paper(start, points, prepared))


def _find_fgr_tuned(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose:
    o3d = require_open3d()
    registration = o3d.pipelines.registration
    scan = _scan_features(points, 4.0)
    o3d.utility.random.seed(_PAPER.seed)
    option = registration.FastGlobalRegistrationOption(
        maximum_correspondence_distance=2.0, decrease_mu=True, iteration_number=128
    )
    result = registration.registration_fgr_based_on_feature_matching(
        scan.cloud, model.cloud, scan.features, model.features, option
    )
    start = _as_pose(np.asarray(result.transformation), is_inverse=True)
    return PeerPose(camera_from_prior=refine_as_paper(start, points, prepared))


def _find_ransac(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose:
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
    start = _as_pose(np.asarray(result.transformation), is_inverse=True)
    return PeerPose(camera_from_prior=refine_as_paper(start, points, prepared))


def _prepare_kiss(prepared: PreparedPrior) -> Any:
    _require("kiss_matcher", "kiss-matcher")
    return list(prepared.points.astype(np.float32))


def _find_kiss(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose | None:
    package = _require("kiss_matcher", "kiss-matcher")
    # without the clamping, which is for metres
    config = package.KISSMatcherConfig(voxel_size=3.0, enable_noise_bound_clamping=False)
    found = package.KISSMatcher(config).estimate(list(points.astype(np.float32)), model)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = found.rotation, np.ravel(found.translation)
    if not np.isfinite(matrix).all():
        return None
    start = _as_pose(matrix, is_inverse=True)
    return PeerPose(
        camera_from_prior=refine_as_paper(start, points, prepared), is_claimed=bool(found.valid)
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


def _find_ppf(model: Any, prepared: PreparedPrior, points: FloatArray) -> PeerPose | None:
    cv2 = _require("cv2", "opencv-contrib-python-headless")
    detector, known = model
    thinned = voxel_downsample(points, 2.0)
    normals = estimate_normals(thinned, _PAPER.normal_neighbours)
    normals = orient_towards(thinned, normals, np.zeros(3))
    scene = np.hstack([thinned, normals]).astype(np.float32)
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
    start = _as_pose(matrix, is_inverse=False)
    return PeerPose(camera_from_prior=refine_as_paper(start, points, prepared))


PEERS: tuple[Peer, ...] = (
    Peer(
        name="fgr_tutorial",
        title="Open3D FPFH + FGR, tutorial",
        package="open3d",
        prepare=lambda prepared: _tutorial_features(prepared.points, _PAPER.voxel_mm),
        find=_find_fgr_tutorial,
    ),
    Peer(
        name="fgr",
        title="Open3D FPFH + FGR, normals turned outward",
        package="open3d",
        prepare=lambda prepared: _prior_features(prepared, _PAPER.voxel_mm),
        find=_find_fgr,
    ),
    Peer(
        name="fgr_tuned",
        title="the same, 4 mm, `decrease_mu`, 128 iterations",
        package="open3d",
        prepare=lambda prepared: _prior_features(prepared, 4.0),
        find=_find_fgr_tuned,
    ),
    Peer(
        name="ransac",
        title="Open3D FPFH + RANSAC, 4 mm, mutual",
        package="open3d",
        prepare=lambda prepared: _prior_features(prepared, 4.0),
        find=_find_ransac,
    ),
    Peer(
        name="kiss",
        title="KISS-Matcher, 3 mm",
        package="kiss-matcher",
        prepare=_prepare_kiss,
        find=_find_kiss,
    ),
    Peer(
        name="ppf",
        title="OpenCV surface_matching, PPF",
        package="opencv-contrib-python-headless",
        prepare=_prepare_ppf,
        find=_find_ppf,
    ),
    Peer(
        name="gicp",
        title="our coarse stage + small_gicp GICP",
        package="small-gicp",
        prepare=_prepare_gicp,
        find=_gicp("GICP"),
        uses_ours=True,
    ),
    Peer(
        name="plane_icp",
        title="our coarse stage + small_gicp PLANE_ICP",
        package="small-gicp",
        prepare=_prepare_gicp,
        find=_gicp("PLANE_ICP"),
        uses_ours=True,
    ),
)
"""All but ours, which `peers_run` calls as `locate` does."""
METHODS: tuple[str, ...] = (*(peer.name for peer in PEERS), OURS)
