"""What the lines of sight to the heads of a posed prior's bolts met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.visibility import head_surface
from boltpose.schema import PriorBolt

_NEIGHBOURS = 6
"""Scan points looked at around every line of sight."""
_CELL_MM = 4.0
"""Of the mask that picks the directions of the heads."""
_SEAT_MM = 0.8
"""So much of a head above its seat says nothing: the seat is there without the head, too."""
_AROUND_MM, _AROUND_WIDTH_MM = 2.5, 3.0
"""A ring around a head that no other head reaches, and where what covers the head goes on."""
_MARGIN_MM = _AROUND_MM + _AROUND_WIDTH_MM
_MOST_POINTS = 500
"""More scan points than these are counted by a part of them."""
_PLANE_MM = 1.5
"""A point this near a point of the prior lies over the same patch of surface."""
_KEY = np.array([0.7548776662466927, 0.5698402909980532, 1.0])
"""Sorts points whatever their order; only copies of a point are as large as another."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltStateConfig:
    """When a bolt counts as seen, and when as missing or another.

    The numbers in the texts are of reman18 and of `boltpose.synthesis.changed_bolts`, both
    simulated.
    """

    min_facing: float = 0.3
    """Cosine of the steepest incidence at which a point of the head is judged."""
    beam_mm: float = 0.8
    """A line of sight meets the scan points this near beside it, or 1.5 spacings of the scan."""
    tolerance_mm: float = 0.6
    """Distance along the normal that still agrees: a pose off by 0.3, dirt of 0.2, noise."""
    proud_mm: float = 0.5
    """Scan points farther than this from every surface of the prior are something else's."""
    min_points: int = 8
    """Points of the head, about 1 mm apart, below which nothing is said."""
    min_share: float = 0.1
    """The same as a share of the head's points, for a head to be confirmed."""
    min_missing_share: float = 0.05
    """The same for a head to be missing: of one seen from the side little is left to miss."""
    through_share: float = 0.25
    """If the camera saw through that much of what it could see of a head, it is not there. Heads
    that are there reach 0.15."""
    proud_share: float = 0.32
    """If so much of the surface in a head's place is no surface of the prior, it is another head.
    Heads that are there reach 0.22, under grease and straps."""
    proud_height_mm: float = 3.5
    """Up to this much above the old head's face a surface may be another head's; heads on one
    thread differ by up to 2.7."""
    max_around_share: float = 0.35
    """Unknown surface around the head, per unknown surface in its place: more is a strap, a cable
    or a jaw that lies over it, and no head."""
    min_proud_points: int = 20
    """Fewer scan points on no surface of the prior are no head."""

    def __post_init__(self) -> None:
        for name in ("beam_mm", "tolerance_mm", "proud_mm", "proud_height_mm"):
            if not getattr(self, name) > 0:  # written so that NaN fails too
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in (
            "min_facing",
            "min_share",
            "min_missing_share",
            "through_share",
            "proud_share",
        ):
            if not 0 < getattr(self, name) < 1:
                raise ConfigError(f"{name} must be in (0, 1), got {getattr(self, name)}")
        if not self.max_around_share >= 0:
            raise ConfigError(f"max_around_share must be >= 0, got {self.max_around_share}")
        for name in ("min_points", "min_proud_points"):
            if not getattr(self, name) >= 3:
                raise ConfigError(f"{name} must be >= 3, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadSight:
    """What the lines of sight to one head met; points of the prior, about 1 mm apart."""

    head_points: int = 0
    """Of the head above its seat, on all sides."""
    agreeing: int = 0
    """Measured where the head should be."""
    through: int = 0
    """The camera saw past or through them."""
    through_mm: float = 0.0
    """Median distance, along the normal, by which it did."""
    unmeasured: int = 0
    """They face the camera, and it measured nothing there."""
    place_points: int = 0
    """Scan points in the head's place."""
    proud_points: int = 0
    """Those of them that are on no surface of the prior."""
    around_points: int = 0
    """Scan points on no surface of the prior that lie around the place."""
    proud_mm: float = 0.0
    """How far the highest of the proud points, but for a tenth, lie above the head's face."""

    @property
    def through_share(self) -> float:
        """Of the head in free sight, what was seen through; 0 to 1."""
        return self.through / max(self.agreeing + self.through, 1)

    @property
    def proud_share(self) -> float:
        """Of the surface measured in the head's place, what is no surface of the prior; 0 to 1."""
        return self.proud_points / max(self.place_points, 1)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Head:
    """The part of a head that faces the camera, posed; lengths in mm, frame `camera`."""

    count: int
    """Points of the whole head above its seat."""
    lines: FloatArray
    """Shape (F, 2), rad: x / z and y / z of the points that face the camera."""
    depth: FloatArray
    """Shape (F,): their z."""
    normal_per_depth: FloatArray
    """Shape (F,): how far along the normal one goes per relative step along the line of sight."""
    centre: FloatArray
    """Shape (2,), rad: the middle of the lines."""
    reach: float
    """Rad: from there, surroundings included."""
    at_mm: float
    """Depth of the head."""


def look_at_heads(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    points: FloatArray,
    config: BoltStateConfig,
) -> tuple[HeadSight, ...]:
    """Follow the lines of sight to every bolt of a prior.

    Args:
        prepared: The prior.
        camera_from_prior: Its pose.
        points: Shape (N, 3), mm, frame `camera`: the whole scan, in any order.
        config: Settings.

    Returns:
        One record per bolt, in the prior's order.
    """
    heads = [_pose_head(prepared, camera_from_prior, b, config) for b in prepared.prior.bolts]
    seen = [head for head in heads if len(head.depth) >= config.min_points]
    points = points[_towards(points, seen)]
    points = points[np.argsort(points @ _KEY)]
    directions = points[:, :2] / points[:, 2:]
    sights: list[HeadSight] = []
    for bolt, head in zip(prepared.prior.bolts, heads, strict=True):
        if len(head.depth) < config.min_points:
            sights.append(HeadSight(head_points=head.count))
            continue
        low, high = head.centre - head.reach, head.centre + head.reach
        u, v = directions.T
        rows = np.flatnonzero((u > low[0]) & (u < high[0]) & (v > low[1]) & (v < high[1]))
        camera_from_bolt = camera_from_prior @ bolt.prior_from_bolt
        place = _look_around(prepared, camera_from_bolt, bolt, points[rows], config)
        sights.append(_follow(head, directions[rows], points[rows, 2], place, config))
    return tuple(sights)


def _pose_head(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    bolt: PriorBolt,
    config: BoltStateConfig,
) -> _Head:
    surface = head_surface(prepared, bolt)
    height = (surface - bolt.prior_from_bolt.translation_mm) @ bolt.prior_from_bolt.z_axis
    surface = surface[height > _SEAT_MM - bolt.head_height_mm]
    _, rows = prepared.tree.query(surface)
    points = camera_from_prior.apply(surface)
    normals = camera_from_prior.rotate(prepared.normals[rows])
    along = -np.einsum("ni,ni->n", points, normals)
    facing = along > config.min_facing * np.linalg.norm(points, axis=1)
    facing &= points[:, 2] > 0
    lines = points[facing, :2] / points[facing, 2:]
    at_mm = float(points[facing, 2].mean()) if facing.any() else 1.0
    centre = lines.mean(axis=0) if len(lines) else np.zeros(2)
    reach = float(np.abs(lines - centre).max()) if len(lines) else 0.0
    return _Head(
        count=len(surface),
        lines=lines,
        depth=points[facing, 2],
        normal_per_depth=along[facing],
        centre=centre,
        reach=reach + _MARGIN_MM / at_mm,
        at_mm=at_mm,
    )


def _towards(points: FloatArray, heads: list[_Head]) -> IntArray:
    """Rows of the points that lie in the directions of any head, before or behind it too."""
    if not len(points) or not heads:
        return np.zeros(0, dtype=np.int64)
    middle = np.array([head.centre for head in heads])
    width = np.array([head.reach for head in heads])
    cell = _CELL_MM / min(head.at_mm for head in heads)
    low = (middle - width[:, None]).min(axis=0)
    count = np.ceil(((middle + width[:, None]).max(axis=0) - low) / cell).astype(np.int64)
    mask = np.zeros(tuple(count + 2), dtype=np.bool_)  # a frame of what lies outside
    first = np.floor((middle - width[:, None] - low) / cell).astype(np.int64) + 1
    last = np.floor((middle + width[:, None] - low) / cell).astype(np.int64) + 2
    for (row, column), (row_end, column_end) in zip(first, last, strict=True):
        mask[row:row_end, column:column_end] = True
    mask[0], mask[-1], mask[:, 0], mask[:, -1] = False, False, False, False
    x, y, depth = points.T
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / (cell * depth)
        row = np.clip(x * scale + (1.0 - low[0] / cell), 0, count[0] + 1)
        column = np.clip(y * scale + (1.0 - low[1] / cell), 0, count[1] + 1)
    ahead = depth > 0
    if not ahead.all():
        row, column = np.where(ahead, row, 0.0), np.where(ahead, column, 0.0)
    flat = row.astype(np.int32) * np.int32(count[1] + 2) + column.astype(np.int32)
    return np.flatnonzero(mask.reshape(-1).take(flat))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """What the scan holds in a head's place."""

    points: int
    proud: int
    around: int
    proud_mm: float


def _follow(
    head: _Head,
    directions: FloatArray,
    depth: FloatArray,
    place: _Place,
    config: BoltStateConfig,
) -> HeadSight:
    """Compare what was measured along every line of sight with the head."""
    margin = config.beam_mm / head.at_mm
    near = (np.abs(directions - head.centre) < head.reach - _MARGIN_MM / head.at_mm + margin).all(
        axis=1
    )
    directions, depth = directions[near], depth[near]
    if len(directions) < _NEIGHBOURS:
        return _sight(head, place, unmeasured=len(head.depth))
    tree = KDTree(directions, balanced_tree=False, compact_nodes=False)
    spacing, _ = tree.query(directions[:: max(1, len(directions) // 50)], k=2)
    beam = max(margin, 1.5 * float(np.median(spacing[:, 1])))
    _, rows = tree.query(head.lines, k=_NEIGHBOURS, distance_upper_bound=beam)
    is_met = rows < len(depth)
    met = depth[np.minimum(rows, len(depth) - 1)]
    # how far behind the head's surface, along its normal, the line of sight ends
    behind = (met / head.depth[:, None] - 1.0) * head.normal_per_depth[:, None]
    measured = np.isfinite(np.where(is_met, behind, np.inf).min(axis=1))
    nearest = np.where(is_met, np.abs(behind), np.inf).min(axis=1)
    least = np.where(is_met, behind, np.inf).min(axis=1)
    through = measured & (least > config.tolerance_mm)
    return _sight(
        head,
        place,
        unmeasured=int(np.sum(~measured)),
        agreeing=int(np.sum(nearest <= config.tolerance_mm)),
        through=int(through.sum()),
        through_mm=float(np.median(least[through])) if through.any() else 0.0,
    )


def _sight(
    head: _Head,
    place: _Place,
    *,
    unmeasured: int,
    agreeing: int = 0,
    through: int = 0,
    through_mm: float = 0.0,
) -> HeadSight:
    return HeadSight(
        head_points=head.count,
        agreeing=agreeing,
        through=through,
        through_mm=through_mm,
        unmeasured=unmeasured,
        place_points=place.points,
        proud_points=place.proud,
        around_points=place.around,
        proud_mm=place.proud_mm,
    )


def _look_around(
    prepared: PreparedPrior,
    camera_from_bolt: Transform,
    bolt: PriorBolt,
    near: FloatArray,
    config: BoltStateConfig,
) -> _Place:
    """Count scan points in a head's place, those that are proud, and those around it."""
    local = camera_from_bolt.inverse().apply(near)
    radius = 0.5 * bolt.head_diameter_mm
    beside = np.hypot(local[:, 0], local[:, 1])
    above = (local[:, 2] > _SEAT_MM - bolt.head_height_mm) & (local[:, 2] < config.proud_height_mm)
    # the corners of a hexagon reach 1.155 radii
    in_place = above & (beside < max(1.16 * radius, radius + 0.8))
    rim = radius + _AROUND_MM
    is_around = above & (beside > rim) & (beside < rim + _AROUND_WIDTH_MM)
    place, place_total = _at_most(local[in_place])
    around, around_total = _at_most(local[is_around])
    both = bolt.prior_from_bolt.apply(np.concatenate([place, around]))
    unknown = is_unknown(prepared, both, config.proud_mm)
    proud = unknown[: len(place)]
    share_proud = float(proud.mean()) if len(place) else 0.0
    share_around = float(unknown[len(place) :].mean()) if len(around) else 0.0
    return _Place(
        points=place_total,
        proud=round(share_proud * place_total),
        around=round(share_around * around_total),
        proud_mm=float(np.quantile(place[proud, 2], 0.9)) if proud.any() else 0.0,
    )


def _at_most(points: FloatArray) -> tuple[FloatArray, int]:
    step = max(1, -(-len(points) // _MOST_POINTS))
    return points[::step], len(points)


def is_unknown(prepared: PreparedPrior, points_prior: FloatArray, threshold_mm: float) -> BoolArray:
    """Which points, frame `prior`, are farther than a threshold from every surface, (N,)."""
    if not len(points_prior):
        return np.zeros(0, dtype=np.bool_)
    distance, rows = prepared.tree.query(points_prior, k=3)
    offset = points_prior[:, None] - prepared.points[rows]
    off_plane = np.abs(np.einsum("nki,nki->nk", offset, prepared.normals[rows]))
    # far beside the prior's points their planes mean nothing
    away = np.where(distance < _PLANE_MM, off_plane, distance)
    return np.asarray(away.min(axis=1) > threshold_mm)
