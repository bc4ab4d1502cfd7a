"""The numbers by which the scene network knows a point of a view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from boltpose.arrays import Float32Array, FloatArray, IntArray, as_points
from boltpose.geometry.local_features import LocalFeatureConfig, compute_local_features
from boltpose.geometry.normals import estimate_normals, orient_towards
from boltpose.geometry.sampling import group_means, voxel_groups
from boltpose.segmentation.context import Neighbourhoods

VOXEL_MM = 5.0
"""Views are thinned to this; the mask is as fine, and is refined after registration."""

SCENE_CONFIG = LocalFeatureConfig(radii_mm=(12.0, 22.0, 40.0, 70.0), neighbours=24)
"""From the edge of a housing to the length of a motor."""

ROTATED_COLUMNS = ([0, 1, 2], [3, 4, 5])
"""Columns that turn with the scene: position and normal."""

SCALED_COLUMNS = [0, 1, 2, 6]
"""Columns that grow with the scene."""

GENERAL_COLUMNS = 9
"""Columns before the local features."""

SCENE_WIDTH = GENERAL_COLUMNS + SCENE_CONFIG.width
"""Number of columns of `features`."""

LOCAL_COLUMNS = [2, *range(5, SCENE_WIDTH)]
"""Columns stage one reads: all that do not turn with the scene."""

CONTEXT_RADII_MM = (12.0, 25.0, 50.0)
"""Neighbourhoods over which stage one's probabilities are averaged for stage two."""

SCENE_INPUT_WIDTH = SCENE_WIDTH + 1 + len(CONTEXT_RADII_MM)
"""Number of columns stage two reads."""

_MAX_VOXELS = 40000
"""reman18 has 6000 to 9000. More is no clamp but a hall, or noise: it is thinned further, so that
the time is bounded; the network was not trained for it."""
_COARSER = 1.5
_NORMAL_NEIGHBOURS = 12
_PLANE_HYPOTHESES = 200
_PLANE_TOLERANCE_MM = 4.0
_MAX_SHARE_BEHIND = 0.1
_STANDING_MM = 30.0
"""Points this far above the plate stand on it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SceneFeatures:
    """A view as the scene network sees it."""

    points: FloatArray
    """Shape (G, 3), mm, frame `camera`: mean of the points of every voxel."""
    features: Float32Array
    """Shape (G, SCENE_WIDTH)."""
    voxel: IntArray
    """Shape (N,), for every point of the view the row it belongs to."""


def compute_scene_features(points_camera: npt.ArrayLike) -> SceneFeatures:
    """Thin a view and describe what is left.

    The scene is turned so that the plate under the clamp is level: z along its normal, y away
    from the camera, the origin on the plate under the middle of what stands on it. Columns:
    position (100 mm) and normal in that frame; distance from its z axis (100 mm); height as a
    share of the scene's; the normal's share towards the camera; then the local features with
    that z axis as up.

    Args:
        points_camera: Shape (N, 3), N >= 3, mm, frame `camera`.

    Raises:
        ShapeError: The shape is another one or a value is not finite.
    """
    cloud = as_points(points_camera, "points_camera", at_least=3)
    voxel_mm = VOXEL_MM
    voxel = voxel_groups(cloud, voxel_mm)
    while voxel.max() >= _MAX_VOXELS:
        voxel_mm *= _COARSER
        voxel = voxel_groups(cloud, voxel_mm)
    points = group_means(cloud, voxel)
    if len(points) < 3:
        points = np.concatenate([points, np.repeat(points[-1:], 3 - len(points), axis=0)])
    normals = orient_towards(points, estimate_normals(points, _NORMAL_NEIGHBOURS), (0.0, 0.0, 0.0))
    ground_normal, ground_height = find_ground(points, normals)
    rotation = _level(ground_normal)
    level = points @ rotation.T - (0.0, 0.0, ground_height)
    standing = level[:, 2] > _STANDING_MM
    centre = np.median(level[standing] if standing.any() else level, axis=0)
    level[:, :2] -= centre[:2]
    rays = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-9)
    general = np.column_stack(
        [
            level / 100,
            normals @ rotation.T,
            np.linalg.norm(level[:, :2], axis=1) / 100,
            level[:, 2] / max(float(np.quantile(level[:, 2], 0.98)), _STANDING_MM),
            -np.einsum("ni,ni->n", normals, rays),
        ]
    ).astype(np.float32)
    local = compute_local_features(points, normals, ground_normal, SCENE_CONFIG)
    return SceneFeatures(
        points=points, features=np.concatenate([general, local], axis=1), voxel=voxel
    )


def _level(up: FloatArray) -> FloatArray:
    """Rotation, (3, 3), into axes with z along `up` and y away from the camera."""
    away: FloatArray = np.array([0.0, 0.0, 1.0]) - up[2] * up
    if np.linalg.norm(away) < 0.1:  # seen from straight above: the top of the picture is away
        away = np.array([0.0, -1.0, 0.0]) + up[1] * up
    away /= np.linalg.norm(away)
    return np.stack([np.cross(away, up), away, up])


def find_ground(
    points: FloatArray, normals: FloatArray, *, seed: int = 0
) -> tuple[FloatArray, float]:
    """Find the largest plane that hardly anything lies behind, as the plate under a clamp.

    Args:
        points: Shape (N, 3), mm, frame `camera`.
        normals: Shape (N, 3), unit, towards the camera.
        seed: Of the planes tried.

    Returns:
        Unit normal, shape (3,), towards the camera, and the plane's height along it, mm. Where
        there is no such plane: the plane across the viewing axis behind the farthest points.
    """
    rng = np.random.default_rng(seed)
    tried = rng.integers(0, len(points), size=min(_PLANE_HYPOTHESES, len(points)))
    candidates = normals[tried]
    offsets = np.einsum("hi,hi->h", candidates, points[tried])
    height = points @ candidates.T - offsets
    on_plane = (np.abs(height) < _PLANE_TOLERANCE_MM) & (normals @ candidates.T > 0.9)
    behind = (height < -3 * _PLANE_TOLERANCE_MM).mean(axis=0)
    score = np.where(behind < _MAX_SHARE_BEHIND, on_plane.sum(axis=0), -1)
    best = int(np.argmax(score))
    if score[best] < 3:
        return np.array([0.0, 0.0, -1.0]), float(-np.quantile(points[:, 2], 0.98))
    members = points[on_plane[:, best]]
    centre = members.mean(axis=0)
    normal = np.linalg.eigh((members - centre).T @ (members - centre))[1][:, 0]
    normal = normal if normal @ candidates[best] > 0 else -normal
    return normal, float(centre @ normal)


def assemble_scene_inputs(described: SceneFeatures, motor: Float32Array) -> Float32Array:
    """Join what stage two reads.

    Args:
        described: The view.
        motor: Shape (G,), stage one's probability of motor.

    Returns:
        Shape (G, SCENE_INPUT_WIDTH).
    """
    around = Neighbourhoods(described.points, CONTEXT_RADII_MM).average(motor[:, None])
    return np.concatenate([described.features, motor[:, None], around], axis=1, dtype=np.float32)
