"""Points to a shaded image: depth buffer, splats, light; numpy alone, no graphics card."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from boltpose.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from boltpose.picture.view import View

IndexArray = npt.NDArray[np.int32]

_EDGE_MM = 3.0
"""Neighbouring pixels further apart in depth than this belong to different surfaces."""
_CREASE_MM = 8.0
"""Lying this far behind a neighbour is as dark as it gets."""
_CREASE_RADII_PX = (2, 5)


@dataclass(frozen=True, slots=True, eq=False)
class DepthImage:
    """What the viewer sees in every pixel."""

    depth: Float32Array
    """Shape (H, W), mm; inf where nothing is. Single precision: 1e-4 mm at 2 m."""
    index: IndexArray
    """Shape (H, W), row of the point seen; -1 where nothing is."""

    @property
    def filled(self) -> BoolArray:
        """Shape (H, W), where a point is seen."""
        return self.index >= 0


def rasterise(view: View, points: FloatArray, splat_mm: float) -> DepthImage:
    """Draw every point as a small square and keep the nearest in each pixel.

    Args:
        view: From where.
        points: Shape (N, 3), mm, the frame of `view.view_from_scene`.
        splat_mm: Edge of the squares; the point spacing closes the surface.

    Returns:
        Depth and point index per pixel.
    """
    height, width = view.height, view.width
    projected = view.project(points)
    column = np.floor(projected[:, 0]).astype(np.int64)
    row = np.floor(projected[:, 1]).astype(np.int64)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    inside &= projected[:, 2] > 0
    chosen = np.flatnonzero(inside).astype(np.int32)
    pixel = row[chosen] * width + column[chosen]
    distance = projected[chosen, 2].astype(np.float32)
    depth = np.full(height * width, np.inf, dtype=np.float32)
    np.minimum.at(depth, pixel, distance)
    index = np.full(height * width, -1, dtype=np.int32)
    is_nearest = distance == depth[pixel]
    # of repeated targets numpy keeps the last value: the later of two equally near points
    index[pixel[is_nearest]] = chosen[is_nearest]
    depth, index = depth.reshape(height, width), index.reshape(height, width)
    reach = int(np.clip(round(splat_mm * view.pixels_per_mm / 2), 0, 12))
    for axis in (0, 1):
        depth, index = _grow(depth, index, reach, axis)
    return DepthImage(depth, index)


def _grow(
    depth: Float32Array, index: IndexArray, reach: int, axis: int
) -> tuple[Float32Array, IndexArray]:
    """Spread each pixel along one axis, the nearest winning; two axes make a square."""
    nearest, owner = depth.copy(), index.copy()
    length = depth.shape[axis]
    for shift in [*range(-reach, 0), *range(1, reach + 1)]:
        source = [slice(None), slice(None)]
        target = [slice(None), slice(None)]
        source[axis] = slice(max(0, -shift), length - max(0, shift))
        target[axis] = slice(max(0, shift), length - max(0, -shift))
        moved, moved_owner = depth[tuple(source)], index[tuple(source)]
        kept, kept_owner = nearest[tuple(target)], owner[tuple(target)]
        wins = moved < kept
        np.copyto(kept, moved, where=wins)
        np.copyto(kept_owner, moved_owner, where=wins)
    return nearest, owner


def light(image: DepthImage, view: View, *, smooth_mm: float = 0.6) -> Float32Array:
    """Brightness of every pixel: a lamp above the viewer's left shoulder, and dark creases.

    Normals come from the depth image itself, smoothed without crossing depth edges.

    Args:
        image: Of `rasterise`.
        view: The same view.
        smooth_mm: Reach of the smoothing; more hides noise, and detail.

    Returns:
        Shape (H, W), 0 to 1; 0 where nothing is.
    """
    filled = image.filled
    pixel_mm = 1.0 / view.pixels_per_mm
    # the far side shines through gaps between splats as specks: take the surface around them
    speck = max(3, round(2 * smooth_mm / pixel_mm))
    depth = np.where(filled, image.depth, np.float32(0))
    closed = ndimage.grey_opening(depth, size=(speck, speck))
    depth = np.where(filled & (closed > 0), closed, depth)
    flat = _smooth(depth, filled, max(0.7, smooth_mm / pixel_mm))
    slope_x = _slope(flat, filled, axis=1) / pixel_mm
    slope_y = _slope(flat, filled, axis=0) / pixel_mm
    # the normal of z = f(x, y), towards the viewer, is (slope_x, slope_y, -1)
    length = np.sqrt(slope_x**2 + slope_y**2 + 1)
    lamp = (-0.35, -0.55, -0.76)
    diffuse = (slope_x * lamp[0] + slope_y * lamp[1] - lamp[2]) / length
    facing = 1 / length
    brightness = 0.30 + 0.50 * np.clip(diffuse, 0, 1) + 0.20 * facing
    return np.where(filled, np.clip(brightness * _creases(depth, filled), 0, 1), np.float32(0))


def _smooth(depth: Float32Array, filled: BoolArray, sigma_px: float) -> Float32Array:
    """Mean over neighbours, but none across edges; `depth` must be 0 where nothing is."""
    weight = ndimage.gaussian_filter(filled.astype(np.float32), sigma_px)
    mean = ndimage.gaussian_filter(depth, sigma_px) / np.maximum(weight, 1e-9)
    # where the blurred value is far off, an edge runs through: keep the pixel as it was
    return np.where(filled & (np.abs(mean - depth) < _EDGE_MM / 2), mean, depth)


def _slope(depth: Float32Array, filled: BoolArray, axis: int) -> Float32Array:
    """Depth change per pixel; one-sided at edges, 0 where no neighbour is on the surface."""
    total = np.zeros_like(depth)
    count = np.zeros_like(depth)
    step = np.diff(depth, axis=axis)
    pair = [slice(None), slice(None)]
    pair[axis] = slice(1, None)
    last = [slice(None), slice(None)]
    last[axis] = slice(None, -1)
    good = filled[tuple(pair)] & filled[tuple(last)] & (np.abs(step) < _EDGE_MM)
    for side in (pair, last):
        total[tuple(side)] += np.where(good, step, np.float32(0))
        count[tuple(side)] += good
    return (total / np.maximum(count, 1)).astype(np.float32)


def _creases(surface: Float32Array, filled: BoolArray) -> Float32Array:
    """Darken pixels that lie behind their surroundings (eye-dome lighting).

    Source:
        Boucheny, PhD thesis, Universite Joseph Fourier, 2009; here with two radii.
    """
    far = np.float32(surface[filled].max() if filled.any() else 0)
    depth = np.where(filled, surface, far)
    shade = np.zeros_like(depth)
    height, width = depth.shape
    reach = max(_CREASE_RADII_PX)
    padded = np.pad(depth, reach, mode="edge")
    for radius in _CREASE_RADII_PX:
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1)):
            top, left = reach + down * radius, reach + right * radius
            moved = padded[top : top + height, left : left + width]
            shade += np.clip(depth - moved, 0, _CREASE_MM)
    return np.exp(-1.6 * shade / (8 * len(_CREASE_RADII_PX) * _CREASE_MM))


def shrink(image: AnyArray, factor: int) -> FloatArray:
    """Average blocks of `factor` x `factor` pixels, shape (H, W, C): smooth edges."""
    height, width, channels = image.shape
    blocks = image.reshape(height // factor, factor, width // factor, factor, channels)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64))
