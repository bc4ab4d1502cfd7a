"""Scans that hold no motor, the wrong one or too little of it, made from reman18 views."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt, uniform_filter

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.errors import EmptyScanError
from boltpose.schema import Scan

NOISE_MM = 0.08
"""1 sigma of made-up surfaces along z: the middle of what reman18 states for its camera."""


def keep_points(scan: Scan, mask: BoolArray, what: str) -> Scan:
    """Cut a scan down to the points of a mask; the source then names the decoy.

    Raises:
        EmptyScanError: Nothing is left.
    """
    if not mask.any():
        raise EmptyScanError(f"decoy '{what}' of {scan.source} has no point")
    cut = scan.subset(mask)
    return _rename(cut, cut.points, cut.pixels, what)


def mirror_scan(scan: Scan) -> Scan:
    """Mirror a view left to right, pixels too: the scan of a motor that cannot exist.

    No rotation undoes it. Depth stays positive and every ray stays a ray.
    """
    pixels = scan.pixels
    if pixels is not None and scan.grid_shape is not None:
        pixels = pixels * (1, -1) + (0, scan.grid_shape[1] - 1)
    return _rename(scan, scan.points * (-1.0, 1.0, 1.0), pixels, "mirrored")


def noise_in_box(scan: Scan, count: int, rng: np.random.Generator) -> Scan:
    """Scatter points evenly in the bounding box of a scan.

    Args:
        scan: Gives the box.
        count: How many points.
        rng: Random numbers.

    Returns:
        A scan without pixels.
    """
    low, high = scan.points.min(axis=0), scan.points.max(axis=0)
    points = rng.uniform(low, high, size=(count, 3))
    return Scan(points=points, source=f"{scan.source}#noise_in_box")


def noise_in_depth(scan: Scan, rng: np.random.Generator) -> Scan:
    """Keep the rays of a view and give each a random depth within the scan's own range."""
    depth = rng.uniform(scan.points[:, 2].min(), scan.points[:, 2].max(), size=len(scan))
    points = scan.points * (depth / scan.points[:, 2])[:, None]
    return _rename(scan, points, scan.pixels, "noise_in_depth")


def close_hole(
    scan: Scan, is_motor: BoolArray, camera_matrix: FloatArray, rng: np.random.Generator
) -> Scan:
    """Take the motor out of a view and let the clamp around it close the hole.

    Each pixel of the motor gets the depth of the nearest clamp pixel, smoothed, with noise: an
    empty clamp that shows measured surface where the motor would be.

    Args:
        scan: A view with pixels.
        is_motor: Shape (N,), which points are the motor's.
        camera_matrix: Shape (3, 3), pixels.
        rng: Random numbers for the noise.

    Returns:
        A view with as many points.

    Raises:
        EmptyScanError: All points are the motor's.
    """
    if is_motor.all():
        raise EmptyScanError(f"{scan.source} has no clamp around its motor")
    pixels, shape = _grid(scan)
    depth = np.zeros(shape)
    known = np.zeros(shape, dtype=np.bool_)
    clamp = pixels[~is_motor]
    depth[clamp[:, 0], clamp[:, 1]] = scan.points[~is_motor, 2]
    known[clamp[:, 0], clamp[:, 1]] = True
    nearest = np.asarray(
        distance_transform_edt(~known, return_distances=False, return_indices=True)
    )
    filled = uniform_filter(depth[nearest[0], nearest[1]], size=25)
    motor = pixels[is_motor]
    points = np.array(scan.points)
    new_depth = filled[motor[:, 0], motor[:, 1]] + rng.normal(0, NOISE_MM, len(motor))
    points[is_motor] = pixel_rays(motor, camera_matrix) * new_depth[:, None]
    return _rename(scan, points, scan.pixels, "hole_closed")


def plain_table(scan: Scan, camera_matrix: FloatArray, rng: np.random.Generator) -> Scan:
    """Replace everything by one plane through the middle of the scan, 25 deg off the view."""
    pixels, _ = _grid(scan)
    normal = np.array([0.0, np.sin(np.radians(25)), -np.cos(np.radians(25))])
    centre = np.array([0.0, 0.0, float(np.median(scan.points[:, 2]))])
    rays = pixel_rays(pixels, camera_matrix)
    depth = (centre @ normal) / (rays @ normal) + rng.normal(0, NOISE_MM, len(rays))
    return _rename(scan, rays * depth[:, None], scan.pixels, "plain_table")


def swap_for_cylinder(
    scan: Scan,
    is_motor: BoolArray,
    camera_matrix: FloatArray,
    *,
    centre_mm: FloatArray,
    axis: FloatArray,
    radius_mm: float,
    length_mm: float,
    rng: np.random.Generator,
) -> Scan:
    """Clamp a plain closed cylinder, the size of the motor's housing, in place of the motor.

    Args:
        scan: A view with pixels.
        is_motor: Shape (N,), which points are the motor's; they are taken out.
        camera_matrix: Shape (3, 3), pixels.
        centre_mm: Shape (3,), mm, frame `camera`: middle of the cylinder.
        axis: Shape (3,), unit, frame `camera`.
        radius_mm: Of the cylinder.
        length_mm: Of the cylinder.
        rng: Random numbers for the noise.

    Returns:
        The clamp's points and those of the cylinder that no clamp hides.
    """
    pixels, shape = _grid(scan)
    depth = np.full(shape, np.inf)
    clamp = pixels[~is_motor]
    depth[clamp[:, 0], clamp[:, 1]] = scan.points[~is_motor, 2]
    every = np.argwhere(np.ones(shape, dtype=np.bool_))
    rays = pixel_rays(every, camera_matrix)
    hit = _hit_cylinder(rays, centre_mm, axis, radius_mm, length_mm)
    hit += rng.normal(0, NOISE_MM, len(hit))
    nearest = np.minimum(depth.reshape(-1), hit)
    seen = np.isfinite(nearest)
    return Scan(
        points=rays[seen] * nearest[seen, None],
        pixels=every[seen],
        grid_shape=shape,
        source=f"{scan.source}#cylinder",
    )


def pixel_rays(pixels: IntArray, camera_matrix: FloatArray) -> FloatArray:
    """Points at depth 1 behind pixels, shape (N, 2) as row and column; returns (N, 3)."""
    x = (pixels[:, 1] - camera_matrix[0, 2]) / camera_matrix[0, 0]
    y = (pixels[:, 0] - camera_matrix[1, 2]) / camera_matrix[1, 1]
    return np.stack([x, y, np.ones(len(pixels))], axis=1)


def _hit_cylinder(
    rays: FloatArray, centre: FloatArray, axis: FloatArray, radius: float, length: float
) -> FloatArray:
    """Depth, (N,), at which rays from the origin first meet a closed cylinder; inf if never."""
    along = rays @ axis
    middle = centre @ axis
    across = rays - along[:, None] * axis
    offset = centre - middle * axis
    # |s across - offset| = radius, a quadratic in the depth s
    a = np.einsum("ni,ni->n", across, across)
    b = across @ offset
    root = b * b - a * (offset @ offset - radius * radius)
    with np.errstate(divide="ignore", invalid="ignore"):
        side = (b - np.sqrt(root)) / a
        best = np.where((root > 0) & (np.abs(side * along - middle) <= length / 2), side, np.inf)
        for end in (-length / 2, length / 2):
            cap = (middle + end) / along
            gap = np.linalg.norm(cap[:, None] * across - offset, axis=1)
            best = np.where((cap > 0) & (gap <= radius), np.minimum(best, cap), best)
    return best


def _grid(scan: Scan) -> tuple[IntArray, tuple[int, int]]:
    if scan.pixels is None or scan.grid_shape is None:
        raise EmptyScanError(f"{scan.source} has no pixels, wanted an organised view")
    return scan.pixels, scan.grid_shape


def _rename(scan: Scan, points: FloatArray, pixels: IntArray | None, what: str) -> Scan:
    return Scan(
        points=points, pixels=pixels, grid_shape=scan.grid_shape, source=f"{scan.source}#{what}"
    )
