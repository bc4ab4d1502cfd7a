"""FPFH and fast global registration by Open3D: the only module that imports it."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import MissingExtraError
from boltpose.geometry.transforms import Transform


@dataclass(frozen=True, slots=True, eq=False)
class FeatureCloud:
    """A cloud with one FPFH descriptor per point."""

    cloud: Any
    """`open3d.geometry.PointCloud` with normals."""
    features: Any
    """`open3d.pipelines.registration.Feature`."""


def require_open3d() -> Any:
    """Import Open3D.

    Raises:
        MissingExtraError: It is not installed, or a system library it needs (libusb) is not.
    """
    try:
        return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise MissingExtraError("open3d", "bench") from error


def compute_features(points: FloatArray, normals: FloatArray, radius_mm: float) -> FeatureCloud:
    """Describe every point by the angles between the normals around it.

    Args:
        points: Shape (N, 3), mm.
        normals: Shape (N, 3), unit, consistently oriented.
        radius_mm: Neighbourhood of a descriptor.

    Returns:
        The cloud with descriptors.

    Raises:
        MissingExtraError: Open3D is not installed.

    Source:
        Rusu et al., ICRA 2009.
    """
    o3d = require_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=radius_mm, max_nn=100)
    return FeatureCloud(cloud, o3d.pipelines.registration.compute_fpfh_feature(cloud, search))


def match_globally(
    prior: FeatureCloud, scan: FeatureCloud, max_distance_mm: float, seed: int
) -> Transform:
    """Fast global registration of a scan to a prior.

    Args:
        prior: Target.
        scan: Source.
        max_distance_mm: `maximum_correspondence_distance` of Open3D; as in its tutorials
            `decrease_mu` stays False, where it has no effect.
        seed: Of Open3D's global generator, the only way to make it repeat itself.

    Returns:
        `camera_from_prior`. There is always one, right or wrong.

    Raises:
        MissingExtraError: Open3D is not installed.

    Source:
        Zhou, Park, Koltun, ECCV 2016.
    """
    o3d = require_open3d()
    o3d.utility.random.seed(seed)
    option = o3d.pipelines.registration.FastGlobalRegistrationOption(
        maximum_correspondence_distance=max_distance_mm
    )
    result = o3d.pipelines.registration.registration_fgr_based_on_feature_matching(
        scan.cloud, prior.cloud, scan.features, prior.features, option
    )
    return Transform("prior", "camera", np.asarray(result.transformation)).inverse()
