"""A scan in three levels of detail, cut into tiles: what is sent first, and what follows where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import Float32Array, FloatArray, IntArray, UInt8Array
from boltpose.viewer.config import ViewerConfig

COARSE, MIDDLE, FINE = 0, 1, 2
"""Levels; each holds the points that it adds to the one before."""
_TILES = 48
"""Aimed at, of a scan that is large enough to be cut."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tile:
    """A piece of the scan."""

    rows: tuple[IntArray, IntArray, IntArray]
    """By level: rows of the scan, each in one level only."""
    centre_mm: FloatArray
    """Shape (3,), in the middle of its box."""
    radius_mm: float
    """No point is farther from the centre."""

    def count(self, level: int) -> int:
        """Points drawn at a level, those of the coarser ones included."""
        return sum(len(rows) for rows in self.rows[: level + 1])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Detail:
    """A scan, cut."""

    tiles: tuple[Tile, ...]
    spacing_mm: tuple[float, float, float]
    """By level: distance of neighbours when it and the coarser ones are drawn."""

    def count(self, level: int) -> int:
        """Points of the whole scan at a level."""
        return sum(tile.count(level) for tile in self.tiles)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sight:
    """Where a viewer stands, and what the picture can show."""

    position_mm: FloatArray
    """Shape (3,)."""
    forward: FloatArray
    """Shape (3,), unit."""
    half_angle_rad: float
    """From the middle of the picture to its corner."""
    pixels_per_rad: float


def cut(points: FloatArray, config: ViewerConfig) -> Detail:
    """Sort the points of a scan into levels, evenly over its surface, and into tiles.

    Args:
        points: Shape (N, 3), mm; any frame.
        config: How many points a level has.

    Returns:
        Every point in exactly one tile and level; the same for the same scan.
    """
    count = len(points)
    if count == 0:
        return Detail(tiles=(), spacing_mm=(1.0, 1.0, 1.0))
    single = points.astype(np.float32)
    coarse_mm = _voxel_for(single, config.first_points)
    level = np.full(count, FINE, dtype=np.uint8)
    middle_mm = coarse_mm
    if count <= config.first_points:
        level[:] = COARSE
    else:
        total = config.first_points + config.middle_points
        middle_mm = coarse_mm * float(np.sqrt(config.first_points / min(total, count)))
        level[_spread(single, middle_mm, total)] = MIDDLE
        if count <= total:
            level[level == FINE] = MIDDLE
        level[_spread(single, coarse_mm, config.first_points)] = COARSE
    shown = [int((level <= step).sum()) for step in (COARSE, MIDDLE, FINE)]
    spacing = [coarse_mm * float(np.sqrt(shown[0] / max(each, 1))) for each in shown]
    return Detail(
        tiles=_tiles(single, level, coarse_mm * float(np.sqrt(shown[0] / _TILES))),
        spacing_mm=(spacing[0], spacing[1], spacing[2]),
    )


def wanted_levels(
    detail: Detail, sight: Sight, config: ViewerConfig, *, is_moving: bool
) -> list[int]:
    """Choose the level of every tile for a viewer.

    Args:
        detail: The scan.
        sight: Of the viewer.
        config: Budgets.
        is_moving: True while the view turns: then few points, and no new ones.

    Returns:
        One level per tile. Fine tiles are those in the picture whose middle points lie more than
        `detail_px` apart on the screen, the nearest first until the budget is spent.
    """
    levels = [MIDDLE] * len(detail.tiles)
    budget = config.moving_points if is_moving else config.still_points
    if is_moving and detail.count(MIDDLE) > budget:
        return [COARSE] * len(detail.tiles)
    left = budget - detail.count(MIDDLE)
    for distance, row in sorted(_in_sight(detail.tiles, sight)):
        apart_px = detail.spacing_mm[MIDDLE] / distance * sight.pixels_per_rad
        cost = len(detail.tiles[row].rows[FINE])
        if apart_px <= config.detail_px or cost > left:
            break
        levels[row] = FINE
        left -= cost
    return levels


def _in_sight(tiles: Sequence[Tile], sight: Sight) -> list[tuple[float, int]]:
    """Distance, mm, and row of every tile that reaches into the picture."""
    found: list[tuple[float, int]] = []
    for row, tile in enumerate(tiles):
        offset = tile.centre_mm - sight.position_mm
        distance = float(np.linalg.norm(offset))
        nearest = max(distance - tile.radius_mm, 1.0)
        if distance > tile.radius_mm:
            angle = float(np.arccos(np.clip(offset @ sight.forward / distance, -1, 1)))
            if angle > sight.half_angle_rad + float(np.arcsin(tile.radius_mm / distance)):
                continue
        found.append((nearest, row))
    return found


def _voxel_for(points: Float32Array, count: int) -> float:
    """Edge of voxels of which about `count` hold points; the finest that is worth it."""
    sample = points[:: max(1, len(points) // (4 * count))]
    extent = float(np.ptp(sample, axis=0).max())
    if extent <= 0:
        return 1.0
    # as if the points filled a square; stray points make it too large at first
    voxel_mm = max(extent / float(np.sqrt(count)), 1e-3)
    for _ in range(5):
        found = len(_one_per_voxel(sample, voxel_mm))
        share = found / min(count, len(sample))
        if 0.8 < share < 1.25:
            break
        # points on a surface: their number falls with the square of the edge
        voxel_mm *= float(np.sqrt(share))
    # a stray point far away must not make more voxels than a number can count
    return max(voxel_mm, extent / 1e6)


def _spread(points: Float32Array, voxel_mm: float, count: int) -> IntArray:
    """Rows of about `count` points, evenly over the surface; chosen among four times as many."""
    step = max(1, len(points) // (4 * count))
    return _one_per_voxel(points[::step], voxel_mm) * step


def _one_per_voxel(points: Float32Array, voxel_mm: float) -> IntArray:
    """The first point of every voxel; a long scan makes no difference to which one that is."""
    cell = np.floor((points - points.min(axis=0)) / np.float32(voxel_mm)).astype(np.int64)
    size = cell.max(axis=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    return np.unique(key, return_index=True)[1]


def _tiles(points: Float32Array, level: UInt8Array, edge_mm: float) -> tuple[Tile, ...]:
    cell = np.floor((points - points.min(axis=0)) / np.float32(max(edge_mm, 1e-3))).astype(np.int64)
    size = cell.max(axis=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    sort_key = 3 * key + level
    if int(size.prod()) * 3 < 65536:
        sort_key = sort_key.astype(np.uint16)  # numpy sorts short integers in linear time
    order = np.argsort(sort_key, kind="stable")
    ends = np.flatnonzero(np.diff(key[order])) + 1
    tiles: list[Tile] = []
    for rows in np.split(order, ends):
        low, high = points[rows].min(axis=0), points[rows].max(axis=0)
        starts = np.searchsorted(level[rows], (MIDDLE, FINE))
        coarse, middle, fine = np.split(rows, starts)
        tiles.append(
            Tile(
                rows=(coarse, middle, fine),
                centre_mm=0.5 * (low + high).astype(np.float64),
                radius_mm=0.5 * float(np.linalg.norm(high - low)),
            )
        )
    return tuple(tiles)
