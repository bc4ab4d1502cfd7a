"""What the surface around each point looks like, at several sizes, from every measured point.

A bolt is 5 of 2048 random points of a scan but 200 of all of them: networks that are to find it
need numbers that were computed before the thinning.
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import Float32Array, FloatArray, as_points
from boltpose.errors import ShapeError
from boltpose.geometry.sampling import group_means, voxel_groups

FEATURES_PER_RADIUS = 14
"""Columns that every radius contributes."""

_CHUNK = 2048
_THREADS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalFeatureConfig:
    """Sizes at which the surroundings of a point are described."""

    radii_mm: tuple[float, ...] = (1.8, 3.0, 5.0, 9.0, 15.0)
    """From the flank of a bolt's head to the diameter of a solenoid's cap."""
    voxels_per_radius: float = 3.0
    """Surroundings are thinned to radius / this, so that every radius costs the same."""
    neighbours: int = 32
    """The most thinned points looked at; about 28 lie on a plane within the radius."""

    def __post_init__(self) -> None:
        rises = all(small < large for small, large in itertools.pairwise((0.0, *self.radii_mm)))
        if not self.radii_mm or not rises:
            raise ValueError(f"radii_mm must be > 0 and rise, got {self.radii_mm}")
        if not self.voxels_per_radius > 0:
            raise ValueError(f"voxels_per_radius must be > 0, got {self.voxels_per_radius}")
        if self.neighbours < 4:
            raise ValueError(f"neighbours must be >= 4, got {self.neighbours}")

    @property
    def width(self) -> int:
        """Number of columns."""
        return FEATURES_PER_RADIUS * len(self.radii_mm)


def compute_local_features(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    up: npt.ArrayLike,
    config: LocalFeatureConfig | None = None,
    *,
    at: npt.ArrayLike | None = None,
) -> Float32Array:
    """Describe the surroundings of points at several radii, without units.

    Nothing in the result changes when the scan is turned together with `up`, or mirrored, except
    for the grid on which surroundings are thinned.

    Args:
        points: Shape (N, 3), N >= 1, mm, any frame.
        normals: Shape (N, 3), unit, signs consistent.
        up: Shape (3,), or (N, 3) with one direction per point; unit, same frame.
        config: The radii.
        at: Indices, shape (M,), of the points to describe; all by default.

    Returns:
        Shape (N or M, `config.width`): per radius shape from the spread of the neighbours
        (linear, planar, bulky), where neighbours stand relative to the tangent plane (mean, rms,
        lowest, highest) and to the height (mean, lowest, highest), and how their normals agree
        with the point's, with `up` and among themselves.

    Raises:
        ShapeError: An argument has the wrong shape or is not finite.

    Source:
        Weinmann et al., ISPRS Journal 105, 2015 (eigenvalue features); the others are ours.
    """
    setting = config or LocalFeatureConfig()
    cloud = as_points(points, "points")
    directions = as_points(normals, "normals")
    if directions.shape != cloud.shape:
        raise ShapeError(f"normals must have shape {cloud.shape}, got {directions.shape}")
    upward = np.asarray(up, dtype=np.float64)
    if upward.shape not in ((3,), cloud.shape):
        raise ShapeError(f"up must have shape (3,) or {cloud.shape}, got {upward.shape}")
    index = np.arange(len(cloud)) if at is None else np.asarray(at, dtype=np.int64)
    # neighbours in space become neighbours in memory: the trees answer twice as fast
    order = np.argsort(voxel_groups(cloud, setting.radii_mm[-1])[index], kind="stable")
    index = index[order]
    queries, own = cloud[index], directions[index]
    heights = np.broadcast_to(upward, cloud.shape)[index]
    result = np.zeros((len(index), setting.width), dtype=np.float32)
    starts = range(0, len(index), _CHUNK)
    for number, radius in enumerate(setting.radii_mm):
        group = voxel_groups(cloud, radius / setting.voxels_per_radius)
        support = group_means(np.column_stack([cloud, directions]), group)
        tree = KDTree(support[:, :3])
        rows = np.ascontiguousarray(support.T.astype(np.float32))
        columns = slice(number * FEATURES_PER_RADIUS, (number + 1) * FEATURES_PER_RADIUS)

        def describe(
            start: int,
            tree: KDTree = tree,
            support: Float32Array = rows,
            radius: float = radius,
            columns: slice = columns,
        ) -> None:
            part = slice(start, start + _CHUNK)
            result[part, columns] = _describe(
                queries[part], own[part], heights[part], tree, support, radius, setting.neighbours
            )

        with ThreadPoolExecutor(_THREADS) as pool:
            list(pool.map(describe, starts))
    back = np.zeros_like(result)
    back[order] = result
    return back


def _describe(
    points: FloatArray,
    normals: FloatArray,
    up: FloatArray,
    tree: KDTree,
    support: Float32Array,
    radius_mm: float,
    neighbours: int,
) -> Float32Array:
    """Features of one radius for a chunk of points; shape (n, FEATURES_PER_RADIUS)."""
    distance, index = tree.query(points, k=min(neighbours, tree.n))
    distance = np.reshape(distance, (len(points), -1))
    index = np.reshape(index, distance.shape)
    # one array per coordinate: plain products run many times faster than small einsums
    x, y, z, other_x, other_y, other_z = (column[index] for column in support)
    scaled = (distance / radius_mm).astype(np.float32)
    # smooth weights: a neighbour entering at the rim must not make the features jump
    weight = np.maximum(1.0 - scaled * scaled, 0.0)
    share = weight / np.maximum(weight.sum(axis=1, keepdims=True), np.float32(1e-6))
    inside = weight > 0

    inverse = np.float32(1 / radius_mm)
    own_x, own_y, own_z = normals.T.astype(np.float32)[:, :, None]
    up_x, up_y, up_z = up.T.astype(np.float32)[:, :, None]
    here_x, here_y, here_z = points.T.astype(np.float32)[:, :, None]
    x, y, z = (x - here_x) * inverse, (y - here_y) * inverse, (z - here_z) * inverse
    above_plane = (x * own_x + y * own_y + z * own_z) * inside
    above_point = (x * up_x + y * up_y + z * up_z) * inside
    mean_x, mean_y, mean_z = _mean(share, x), _mean(share, y), _mean(share, z)
    x, y, z = x - mean_x, y - mean_y, z - mean_z
    share_x, share_y, share_z = share * x, share * y, share * z
    spread = np.sqrt(
        _eigenvalues(
            _total(share_x, x),
            _total(share_y, y),
            _total(share_z, z),
            _total(share_x, y),
            _total(share_x, z),
            _total(share_y, z),
        )
    )
    normal_x, normal_y, normal_z = (
        _mean(share, other_x),
        _mean(share, other_y),
        _mean(share, other_z),
    )
    normal_up = other_x * up_x + other_y * up_y + other_z * up_z
    largest = np.maximum(spread[0], np.float32(1e-6))
    columns = [
        (spread[0] - spread[1]) / largest,
        (spread[1] - spread[2]) / largest,
        spread[2] / largest,
        _total(share, above_plane),
        np.sqrt(_total(share, above_plane * above_plane)),
        above_plane.min(axis=1),
        above_plane.max(axis=1),
        _total(share, above_point),
        above_point.min(axis=1),
        above_point.max(axis=1),
        (normal_x * own_x + normal_y * own_y + normal_z * own_z)[:, 0],
        (normal_x * up_x + normal_y * up_y + normal_z * up_z)[:, 0],
        np.sqrt(normal_x * normal_x + normal_y * normal_y + normal_z * normal_z)[:, 0],
        _total(share, normal_up * normal_up),
    ]
    return np.stack(columns, axis=1)


def _total(weights: Float32Array, values: Float32Array) -> Float32Array:
    """Sum of products along the neighbours; (n, k) twice to (n,)."""
    return np.einsum("nk,nk->n", weights, values)


def _mean(share: Float32Array, values: Float32Array) -> Float32Array:
    """Weighted mean along the neighbours, kept as a column; (n, k) twice to (n, 1)."""
    return _total(share, values)[:, None]


def _eigenvalues(
    xx: Float32Array,
    yy: Float32Array,
    zz: Float32Array,
    xy: Float32Array,
    xz: Float32Array,
    yz: Float32Array,
) -> Float32Array:
    """Eigenvalues, (3, n) falling and not negative, of symmetric matrices given by their entries.

    In closed form: no eigenvectors are needed, and LAPACK is ten times slower on small matrices.

    Source:
        Smith, Communications of the ACM 4(4), 1961, p. 168.
    """
    # in single precision nearly flat neighbourhoods would lose their smallest eigenvalue
    a, b, c, d, e, f = np.stack([xx, yy, zz, xy, xz, yz]).astype(np.float64)
    centre = (a + b + c) / 3
    a, b, c = a - centre, b - centre, c - centre
    off = d * d + e * e + f * f
    scale = np.sqrt(np.maximum((a * a + b * b + c * c + 2 * off) / 6, 1e-18))
    determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    angle = np.arccos(np.clip(determinant / (2 * scale**3), -1.0, 1.0)) / 3
    first = centre + 2 * scale * np.cos(angle)
    last = centre + 2 * scale * np.cos(angle + 2 * np.pi / 3)
    middle = 3 * centre - first - last
    return np.maximum(np.stack([first, middle, last]), 0.0).astype(np.float32)
