"""What registration needs of a prior and computes once for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, Float32Array, FloatArray, freeze
from boltpose.geometry.normals import fibonacci_directions
from boltpose.registration.config import PrepareConfig
from boltpose.registration.grid import NearestGrid, build_nearest_grid, thin_with_normals
from boltpose.schema import Part, Prior


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PreparedPrior:
    """A prior with its search structures; build once, use for every scan."""

    prior: Prior
    points: FloatArray
    """Shape (N, 3), mm, frame `prior`, about 1 mm apart: the surface of the fine stage."""
    normals: FloatArray
    """Shape (N, 3), unit, outward."""
    is_rigid: BoolArray
    """Shape (N,): False on the electrical connector, whose cable may lie elsewhere by now."""
    tree: KDTree
    """Over `points`."""
    coarse_points: Float32Array
    """Shape (M, 3), mm, frame `prior`, behind `grid`."""
    coarse_normals: Float32Array
    """Shape (M, 3), unit, outward."""
    coarse_spacing_mm: float
    """Voxel that `coarse_points` were thinned to."""
    grid: NearestGrid
    """Over `coarse_points`."""
    view_directions: FloatArray
    """Shape (V, 3), unit, from the motor to a viewer."""
    view_centroids: FloatArray
    """Shape (V, 3), mm: mean of the surface that viewer sees."""
    centre_mm: FloatArray
    """Shape (3,): middle of the motor's box."""
    radius_mm: float
    """Largest distance of a point from `centre_mm`."""


def prepare_prior(prior: Prior, config: PrepareConfig | None = None) -> PreparedPrior:
    """Thin a prior, build its nearest-point structures and what each direction would see.

    Raises:
        ShapeError: The prior holds no points.
    """
    config = config or PrepareConfig()
    normals = prior.normals / np.linalg.norm(prior.normals, axis=1, keepdims=True)
    coarse_points, coarse_normals = thin_with_normals(prior.points, normals, config.coarse_voxel_mm)
    directions = fibonacci_directions(config.view_directions)
    centre = 0.5 * (prior.points.min(axis=0) + prior.points.max(axis=0))
    return PreparedPrior(
        prior=prior,
        points=freeze(prior.points),
        normals=freeze(normals),
        is_rigid=freeze(prior.labels != Part.ELECTRICAL_CONNECTOR),
        tree=KDTree(prior.points),
        coarse_points=freeze(coarse_points.astype(np.float32)),
        coarse_normals=freeze(coarse_normals.astype(np.float32)),
        coarse_spacing_mm=config.coarse_voxel_mm,
        grid=build_nearest_grid(
            coarse_points, cell_mm=config.grid_cell_mm, margin_mm=config.grid_margin_mm
        ),
        view_directions=freeze(directions),
        view_centroids=freeze(
            _visible_centroids(coarse_points, coarse_normals, directions, config.view_cell_mm)
        ),
        centre_mm=freeze(centre),
        radius_mm=float(np.linalg.norm(prior.points - centre, axis=1).max()),
    )


def _visible_centroids(
    points: FloatArray, normals: FloatArray, directions: FloatArray, cell_mm: float
) -> FloatArray:
    """Mean of the points each direction sees, from orthographic depth buffers; (V, 3)."""
    centroids = np.zeros((len(directions), 3))
    for row, direction in enumerate(directions):
        helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
        right = np.cross(direction, helper)
        right /= np.linalg.norm(right)
        up = np.cross(direction, right)
        facing = normals @ direction > 0.1
        candidates = points[facing]
        height = candidates @ direction
        u = np.floor((candidates @ right) / cell_mm).astype(np.int64)
        v = np.floor((candidates @ up) / cell_mm).astype(np.int64)
        u -= u.min()
        v -= v.min()
        cell = u * (int(v.max()) + 1) + v
        front = np.full(int(cell.max()) + 1, -np.inf)
        np.maximum.at(front, cell, height)
        visible = height > front[cell] - 2.0 * cell_mm
        centroids[row] = candidates[visible].mean(axis=0)
    return centroids
