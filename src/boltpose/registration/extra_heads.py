"""Heads of bolts that a scan shows and the prior lacks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, Float32Array, FloatArray, as_points, freeze
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.registration.prepare import PreparedPrior
from boltpose.schema import ExtraHead

_CELL_MM = 1.2
"""Points in neighbouring cells of this size belong to one thing."""
_NEIGHBOUR_CELLS = 1.8
"""Cells so many edges apart, middle to middle, are neighbours; corner to corner it is 1.73."""
_REACH_MM = 12.0
"""How far around the motor's surface things are looked at: no head is that high."""
_COARSE_SLACK_MM = 1.0
"""A point this much farther than asked for from the prior's thinned points is worth a look."""
_LARGEST_MM = 22.0
"""Longer things are cables, straps and jaws."""
_FOOT_MM = 2.5
"""The foot of a thing, too near the motor to be told from it, reaches so far around the rest."""
_MIN_CORE_SHARE = 0.6
"""Of the points of a thing so many are clear of the motor."""
_SEAT_MM = 1.5
"""The seat lies at most this much below the foot of a head, and its points this far apart."""
_LEVEL_QUANTILE = 0.97
_FOOT_QUANTILE = 0.03
"""Between these lies the height of a thing; strays do not count."""
_SECTORS = 24
_MIN_SECTORS = 8
_FIT_ROUNDS = 3
_KEY = np.array([0.7548776662466927, 0.5698402909980532, 1.0])
"""Sorts points whatever their order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtraHeadConfig:
    """What must be known of a thing on the motor to call it a bolt's head.

    A hint for a person, no command for a robot: of the 10 heads reported in 456 simulated views 5
    were bolts that the prior lacked and 5 were screws of a clamp (`flange_plate`), and of the
    18 such bolts of which half could be seen 3 were reported.
    """

    unknown_mm: float = 1.0
    """Scan points farther than this from the posed prior are of something it lacks."""
    diameter_mm: tuple[float, float] = (5.0, 19.0)
    """Heads of M4 to M8, flanges included."""
    height_mm: tuple[float, float] = (1.8, 9.0)
    """Of what stands out, as far as it is seen."""
    min_points: int = 40
    """Scan points of the thing."""
    bolt_distance_diameters: float = 1.0
    """Nearer than so many diameters to a bolt of the prior it is that bolt, judged elsewhere."""
    face_mm: float = 0.4
    """So near its highest level a point is of the top face."""
    min_face_share: float = 0.28
    """Share of the points in the top face."""
    min_face_radii: float = 0.5
    """How far the face reaches, in radii of the rim."""
    rim_mm: float = 0.5
    """So near a circle the rim is round; a hexagon's is up to 0.08 of its size off."""
    min_round_share: float = 0.7
    """Share of the rim that is round."""
    max_rim_error_mm: float = 0.8
    """What nine tenths of the rim are within."""
    min_seat_share: float = 0.6
    """Share of the face that has the motor's own surface right below it: parts of a clamp stand
    beside the motor."""
    max_gap_rad: float = 2.1
    """Largest part of the rim that may be unseen, 120 degrees."""

    def __post_init__(self) -> None:
        for name in ("diameter_mm", "height_mm"):
            low, high = getattr(self, name)
            if not 0 < low < high:
                raise ConfigError(f"{name} must increase from > 0, got {low}, {high}")
        for name in (
            "unknown_mm",
            "bolt_distance_diameters",
            "face_mm",
            "min_face_radii",
            "rim_mm",
            "max_rim_error_mm",
            "max_gap_rad",
        ):
            if not getattr(self, name) > 0:  # written so that NaN fails too
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in ("min_face_share", "min_round_share", "min_seat_share"):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be in (0, 1], got {getattr(self, name)}")
        if not self.min_points >= 10:
            raise ConfigError(f"min_points must be >= 10, got {self.min_points}")


def find_extra_heads(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    scan_points: npt.ArrayLike,
    config: ExtraHeadConfig | None = None,
) -> tuple[ExtraHead, ...]:
    """Find what looks like the head of a bolt on the clamped motor where its prior has none.

    Only what is sure is told: a thing of its own on the motor, with a flat, round top across the
    motor's axis, of which most of the rim was seen. A head seen from the side is not found.

    Args:
        prepared: The prior.
        camera_from_prior: Its verified pose.
        scan_points: Shape (N, 3), mm, frame `camera`: the scan, a point every 1 mm at least. Their
            order does not matter.
        config: Settings.

    Returns:
        The heads in frame `camera`, the nearest to the camera first.

    Raises:
        ShapeError: `scan_points` is not (N, 3) and finite.
    """
    config = config or ExtraHeadConfig()
    points = as_points(scan_points, "scan_points", at_least=0)
    local, distance = _around(prepared, camera_from_prior, points, config)
    heads: list[ExtraHead] = []
    axis = prepared.prior.alignment.prior_from_motor.z_axis
    sorted_by_x = local[np.argsort(local[:, 0], kind="stable")]
    for low, high in _things(local[distance > config.unknown_mm + _COARSE_SLACK_MM], config):
        first, last = np.searchsorted(sorted_by_x[:, 0], (low[0] - _FOOT_MM, high[0] + _FOOT_MM))
        slab = sorted_by_x[first:last]
        thing = slab[_inside(slab, low - _FOOT_MM, high + _FOOT_MM)].astype(np.float64)
        if not _may_be_head(thing @ axis, config):
            continue
        away, _ = prepared.tree.query(thing, workers=-1)
        thing, away = thing[away > config.unknown_mm], away[away > config.unknown_mm]
        order = np.argsort(thing @ _KEY)
        head = _as_head(prepared, thing[order], away[order], config)
        if head is not None:
            top = camera_from_prior.apply(head.head_top_mm)
            heads.append(
                ExtraHead(
                    head_top_mm=freeze(top), diameter_mm=head.diameter_mm, height_mm=head.height_mm
                )
            )
    return tuple(sorted(heads, key=lambda head: float(head.head_top_mm[2])))


def _around(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    points: FloatArray,
    config: ExtraHeadConfig,
) -> tuple[Float32Array, Float32Array]:
    """Scan points off the motor's surface but near it.

    Returns:
        Points (U, 3), frame `prior`, and their distance (U,) from the prior's thinned points.
    """
    middle = camera_from_prior.apply(prepared.centre_mm)
    near = np.ones(len(points), dtype=np.bool_)
    for column, centre in zip(points.T, middle, strict=True):
        near &= np.abs(column - centre) < prepared.radius_mm + _REACH_MM
    local = camera_from_prior.inverse().apply(points[near]).astype(np.float32)
    low = prepared.coarse_points.min(axis=0) - np.float32(_REACH_MM)
    high = prepared.coarse_points.max(axis=0) + np.float32(_REACH_MM)
    local = local[_inside(local, low, high)]
    offset = local - prepared.coarse_points[prepared.grid.nearest(local)]
    squared = np.einsum("ni,ni->n", offset, offset)
    off = (squared > config.unknown_mm**2) & (squared < _REACH_MM**2)
    return local[off], np.sqrt(squared[off])


def _inside(points: Float32Array, low: Float32Array, high: Float32Array) -> BoolArray:
    inside = np.ones(len(points), dtype=np.bool_)
    for column, least, most in zip(points.T, low, high, strict=True):
        inside &= (column > least) & (column < most)
    return inside


def _things(
    points: Float32Array, config: ExtraHeadConfig
) -> Iterator[tuple[Float32Array, Float32Array]]:
    """Boxes, low and high corner, around connected things of about a head's size."""
    if len(points) < config.min_points:
        return
    origin = np.floor(points.min(axis=0))
    cells = ((points - origin) / np.float32(_CELL_MM)).astype(np.int64)
    shape = tuple(cells.max(axis=0) + 1)
    codes, counts = np.unique(np.ravel_multi_index(tuple(cells.T), shape), return_counts=True)
    middles = np.stack(np.unravel_index(codes, shape), axis=1)
    pairs = KDTree(middles).query_pairs(_NEIGHBOUR_CELLS, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(codes), len(codes)))
    count, thing_of_cell = connected_components(graph, directed=False)
    sizes = np.bincount(thing_of_cell, weights=counts, minlength=count)
    for number in np.flatnonzero(sizes >= _MIN_CORE_SHARE * config.min_points):
        members = middles[thing_of_cell == number]
        low, high = members.min(axis=0), members.max(axis=0) + 1
        if (high - low).max() * _CELL_MM < _LARGEST_MM:
            yield (
                (low * _CELL_MM + origin).astype(np.float32),
                (high * _CELL_MM + origin).astype(np.float32),
            )


def _may_be_head(heights: FloatArray, config: ExtraHeadConfig) -> bool:
    """Tell, before its distance from the motor is asked for, whether a thing may have a flat top.

    Its foot is among the points yet, so less than the wanted share is asked for.
    """
    if len(heights) < config.min_points:
        return False
    for height in (heights, -heights):
        level = float(np.quantile(height, _LEVEL_QUANTILE))
        if np.mean(np.abs(height - level) < config.face_mm) >= 0.4 * config.min_face_share:
            return True
    return False


def _as_head(
    prepared: PreparedPrior, points: FloatArray, distance: FloatArray, config: ExtraHeadConfig
) -> ExtraHead | None:
    """The head that a thing is, frame `prior`, or None if it may be something else.

    Args:
        prepared: The prior.
        points: Shape (P, 3), mm, frame `prior`, all of the thing.
        distance: Shape (P,), mm, from the prior's surface.
        config: Settings.
    """
    if len(points) < config.min_points:
        return None
    axis = prepared.prior.alignment.prior_from_motor.z_axis
    height = points @ axis
    # out of the motor is where the distance from it grows
    if (height - height.mean()) @ (distance - distance.mean()) < 0:
        axis, height = -axis, -height
    level = float(np.quantile(height, _LEVEL_QUANTILE))
    tall = level - float(np.quantile(height, _FOOT_QUANTILE)) + float(distance.min())
    face = np.abs(height - level) < config.face_mm
    across, up = _plane_axes(axis)
    flat = np.stack([points @ across, points @ up], axis=1)
    circle = _fit_rim(flat, config)
    if circle is None or face.mean() < config.min_face_share:
        return None
    centre, radius = circle
    reached = float(np.quantile(np.linalg.norm(flat[face] - centre, axis=1), 0.9))
    diameter = 2.0 * radius
    top = centre[0] * across + centre[1] * up + level * axis
    bolts = prepared.prior.bolts
    near = min(
        (float(np.linalg.norm(bolt.prior_from_bolt.translation_mm - top)) for bolt in bolts),
        default=np.inf,
    )
    is_head = (
        config.diameter_mm[0] <= diameter <= config.diameter_mm[1]
        and config.height_mm[0] <= tall <= config.height_mm[1]
        and reached >= config.min_face_radii * radius
        and near >= config.bolt_distance_diameters * diameter
    )
    if not is_head:
        return None
    below = prepared.points[
        np.sort(prepared.tree.query_ball_point(top, float(np.hypot(radius, tall)) + _SEAT_MM))
    ]
    depth = level - below @ axis
    below = below[(depth > config.face_mm) & (depth < tall + _SEAT_MM)]
    if not len(below):
        return None
    seat = KDTree(np.stack([below @ across, below @ up], axis=1))
    gap, _ = seat.query(flat[face], distance_upper_bound=_SEAT_MM)
    if np.isfinite(gap).mean() < config.min_seat_share:
        return None
    return ExtraHead(head_top_mm=top, diameter_mm=diameter, height_mm=tall)


def _plane_axes(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    across = np.asarray(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]), dtype=np.float64)
    across = across / np.linalg.norm(across)
    up = np.asarray(np.cross(axis, across), dtype=np.float64)
    return across, up


def _fit_rim(flat: FloatArray, config: ExtraHeadConfig) -> tuple[FloatArray, float] | None:
    """Centre (2,) and radius of the outline of points (P, 2); None if it is not round."""
    middle = flat.mean(axis=0)
    offset = flat - middle
    sector = np.floor(np.arctan2(offset[:, 1], offset[:, 0]) / (2 * np.pi) * _SECTORS)
    order = np.lexsort([np.einsum("ni,ni->n", offset, offset), sector])
    last = np.flatnonzero(np.diff(sector[order], append=np.inf))
    rim = flat[order[last]]
    kept = np.ones(len(rim), dtype=np.bool_)
    centre, radius, error = middle, 0.0, np.zeros(len(rim))
    for _ in range(_FIT_ROUNDS):
        if kept.sum() < _MIN_SECTORS:
            return None
        centre, radius = _fit_circle(rim[kept])
        error = np.abs(np.linalg.norm(rim - centre, axis=1) - radius)
        kept = error < max(config.rim_mm, 2.0 * float(np.median(error)))
    angles = np.sort(np.arctan2(*(rim - centre).T[::-1]))
    gap = float(np.diff(angles, append=angles[0] + 2 * np.pi).max())
    is_round = (
        gap <= config.max_gap_rad
        and np.mean(error < config.rim_mm) >= config.min_round_share
        and np.quantile(error, 0.9) <= config.max_rim_error_mm
    )
    return (centre, radius) if is_round else None


def _fit_circle(points: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius by linear least squares (Kasa, IEEE Trans. Instrum. Meas. 25, 1976)."""
    columns = np.column_stack([2.0 * points, np.ones(len(points))])
    solution, *_ = np.linalg.lstsq(columns, np.einsum("ni,ni->n", points, points), rcond=None)
    return solution[:2], float(np.sqrt(max(solution[2] + solution[:2] @ solution[:2], 0.0)))
