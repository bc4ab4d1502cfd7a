"""The paper's registration: FPFH, fast global registration, three steps of plain ICP."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.geometry.normals import estimate_normals, orient_towards
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import PaperConfig
from boltpose.registration.grid import thin_with_normals
from boltpose.registration.open3d_features import FeatureCloud, compute_features, match_globally
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.rigid_fit import fit_rigid


def register_as_paper(
    prepared: PreparedPrior,
    points_camera: FloatArray,
    config: PaperConfig,
    *,
    is_point_to_plane: bool,
) -> Transform:
    """Register as the paper does, with the set-up that FINDINGS found to make it work.

    Args:
        prepared: The prior.
        points_camera: Shape (N, 3), mm, frame `camera`: motor points.
        config: Settings.
        is_point_to_plane: False for the paper's point-to-point variant.

    Returns:
        `camera_from_prior`. The method itself cannot tell whether it is right: ask `verify`.

    Raises:
        MissingExtraError: Open3D is not installed.

    Source:
        LCE 2024 (arXiv 2505.24669), section 3.3. Changed: the scan is the source and the full
        scan the target (else the share of partners, and with it the fit, is wrong by
        construction); normals are oriented outward and to the camera.
    """
    scan = voxel_downsample(points_camera, config.voxel_mm)
    normals = orient_towards(scan, estimate_normals(scan, config.normal_neighbours), np.zeros(3))
    features = compute_features(scan, normals, config.feature_radius_mm)
    pose = match_globally(
        _prior_features(prepared, config), features, config.match_distance_mm, config.seed
    )
    source = voxel_downsample(points_camera, config.icp_voxel_mm)
    for distance in config.icp_distances_mm:
        pose = run_icp(
            pose,
            source,
            prepared,
            max_distance_mm=distance,
            iterations=config.icp_iterations,
            is_point_to_plane=is_point_to_plane,
        )
    return pose


def run_icp(
    camera_from_prior: Transform,
    points_camera: FloatArray,
    prepared: PreparedPrior,
    *,
    max_distance_mm: float,
    iterations: int,
    is_point_to_plane: bool,
) -> Transform:
    """Plain ICP without a kernel, scan to prior.

    Args:
        camera_from_prior: The pose to start from.
        points_camera: Shape (N, 3), mm, frame `camera`.
        prepared: The prior.
        max_distance_mm: Pairs farther apart are ignored.
        iterations: Most steps; it ends when a step moves the motor by less than 1 micrometre.
        is_point_to_plane: False minimises the distance between the points of a pair.

    Returns:
        The improved pose; the given one if fewer than six points find a partner.

    Source:
        Chen and Medioni, 1992 (planes); Besl and McKay, IEEE TPAMI 14(2), 1992 (points).
    """
    pose = camera_from_prior.inverse()
    for _ in range(iterations):
        moved = pose.apply(points_camera)
        distance, partner = prepared.tree.query(
            moved, distance_upper_bound=max_distance_mm, workers=-1
        )
        has_partner = np.isfinite(distance)
        if int(has_partner.sum()) < 6:
            break
        partner = partner[has_partner]
        if is_point_to_plane:
            step = _plane_step(
                moved[has_partner], prepared.points[partner], prepared.normals[partner]
            )
        else:
            step = fit_rigid(moved[has_partner], prepared.points[partner])
        pose = Transform("prior", "camera", step @ pose.matrix)
        corner = np.append(prepared.centre_mm, 1.0)
        turn = float(np.linalg.norm(step[:3, :3] - np.eye(3)))
        shift = float(np.linalg.norm((step @ corner - corner)[:3]))
        if turn * prepared.radius_mm + shift < 1e-3:
            break
    return pose.inverse()


def _plane_step(points: FloatArray, targets: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the motion, (4, 4), that brings points nearest to their partners' planes."""
    centre = points.mean(axis=0)
    lever = 50.0  # mm; rotations as millimetres at this distance scale the system well
    jacobian = np.hstack([np.cross((points - centre) / lever, normals), normals])
    residuals = np.einsum("ni,ni->n", targets - points, normals)
    matrix = jacobian.T @ jacobian
    matrix += np.eye(6) * 1e-9 * np.trace(matrix)
    motion = np.linalg.solve(matrix, jacobian.T @ residuals)
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec(motion[:3] / lever).as_matrix()
    step[:3, 3] = centre - step[:3, :3] @ centre + motion[3:]
    return step


@lru_cache(maxsize=4)
def _prior_features(prepared: PreparedPrior, config: PaperConfig) -> FeatureCloud:
    """Descriptors of a prior, kept: they are the same for every scan."""
    points, normals = thin_with_normals(prepared.points, prepared.normals, config.voxel_mm)
    return compute_features(points, normals, config.feature_radius_mm)
