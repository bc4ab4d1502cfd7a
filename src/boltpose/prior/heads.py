"""Bolt points -> heads: one candidate per bolt, measured, not yet judged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.errors import ConfigError
from boltpose.geometry.normals import estimate_normals
from boltpose.geometry.primitives import robust_sigma
from boltpose.prior.clustering import ClusterConfig, cluster_points
from boltpose.prior.head_fit import HeadFit, HeadFitConfig, fit_head
from boltpose.schema import Part, Side

_FACING = 0.8
"""Cosine from which a normal counts as along the axis (37 deg: domed faces too)."""
_TURN = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadConfig:
    """From class probabilities to measured heads."""

    seed_probability: float = 0.25
    """Points of at least this bolt probability make clusters; the head itself decides later."""
    cluster: ClusterConfig = field(default_factory=ClusterConfig)
    fit: HeadFitConfig = field(default_factory=HeadFitConfig)
    normal_neighbours: int = 10
    """Of the normals used in the fit; half the usual number, or a counterbore's wall 1.5 mm away
    turns the normals of the flank."""
    face_percentile: float = 92.0
    """Height of the top face among the heights of its points."""
    wide_cluster_mm: float = 9.0
    """A cluster reaching further than this from its middle gets several starts: two heads, or a
    head with mislabelled surroundings."""
    max_heads_per_cluster: int = 4
    max_step_mm: float = 1.2
    """Largest gap between measured heights of one head; a scan has a point every 1 mm."""
    max_fit_sigma_mm: float = 0.6
    """A fit less certain than this is no fit: the middle of the face is better."""

    def __post_init__(self) -> None:
        if not 0 < self.seed_probability < 1:
            raise ConfigError(f"seed_probability must be 0 to 1, got {self.seed_probability}")
        if not 0 < self.face_percentile <= 100:
            raise ConfigError(f"face_percentile must be 0 to 100, got {self.face_percentile}")
        if self.normal_neighbours < 4 or self.max_heads_per_cluster < 1:
            raise ConfigError("normal_neighbours must be >= 4, max_heads_per_cluster >= 1")
        for name in ("wide_cluster_mm", "max_step_mm", "max_fit_sigma_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Head:
    """One candidate, measured in the frame of its side (motor, turned by 180 deg for bottom)."""

    side: Side
    centre_mm: FloatArray
    """Shape (3,), frame `motor`: on the axis, on the top face."""
    fit: HeadFit | None
    """None: neither flank nor cone was found; the centre is that of the face."""
    radius_mm: float
    """Of the flank, or of a disc with the face's area where no flank was found."""
    probability: float
    """Mean bolt probability of all outward points of the head's upper part."""
    terminal_probability: float
    """The same of class electrical connector."""
    face_coverage: float
    """Share of the turn in which the outer part of the top face was seen, 0 to 1."""
    members: IntArray
    """Indices of the cluster's points that belong to this head."""
    level_sigma_mm: float

    @property
    def support(self) -> float:
        """Of the fit; 0 without one."""
        return 0.0 if self.fit is None else self.fit.support


@dataclass(frozen=True, slots=True, eq=False)
class MotorCloud:
    """A full scan in frame `motor` with what the head search needs at every step."""

    points: FloatArray
    normals: FloatArray
    probability: FloatArray
    """Shape (N,), of class bolt."""
    terminal_probability: FloatArray
    """Shape (N,), of class electrical connector, whose nuts look like bolts."""
    columns: KDTree
    """Over x and y: a head is a column of points."""

    @classmethod
    def build(cls, points: FloatArray, normals: FloatArray, shares: FloatArray) -> MotorCloud:
        """Index a cloud; `shares`, shape (N, 6), are the probabilities of classes 1 to 6."""
        bolt = shares[:, int(Part.BOLT) - 1]
        terminal = shares[:, int(Part.ELECTRICAL_CONNECTOR) - 1]
        return cls(points, normals, bolt, terminal, KDTree(points[:, :2]))


def find_heads(cloud: MotorCloud, config: HeadConfig) -> list[Head]:
    """Measure one head per bolt-like cluster, several where a cluster holds several."""
    seeds = np.flatnonzero(cloud.probability >= config.seed_probability)
    heads: list[Head] = []
    for group in cluster_points(cloud.points[seeds], config.cluster):
        heads += _heads_of_cluster(cloud, seeds[group], config)
    return heads


def _heads_of_cluster(cloud: MotorCloud, members: IntArray, config: HeadConfig) -> Iterator[Head]:
    """Take the best head, then look at what it leaves unexplained."""
    rest = members
    for _ in range(config.max_heads_per_cluster):
        head = measure_head(cloud, rest, config)
        yield head
        arm = np.linalg.norm(cloud.points[rest, :2] - head.centre_mm[:2], axis=1)
        left = rest[arm > 1.6 * head.radius_mm + 0.5]
        if len(left) == len(rest):
            return
        rest = left
        groups = cluster_points(cloud.points[rest], config.cluster)
        if not groups:
            return
        rest = rest[np.sort(np.concatenate(groups))]


def measure_head(cloud: MotorCloud, members: IntArray, config: HeadConfig) -> Head:
    """Find side, axis, height and class probability of the head some points belong to."""
    side = _side_of(cloud, members)
    turn = np.eye(3) if side is Side.TOP else _TURN
    local = cloud.points[members] @ turn
    facing = cloud.normals[members] @ turn[:, 2] > _FACING
    face = local[facing] if facing.sum() >= 5 else local
    level = float(np.percentile(face[:, 2], config.face_percentile))
    fit = _best_fit(cloud, turn, _starts(local, config), level, config)
    centre = face[:, :2].mean(axis=0) if fit is None else fit.centre_mm
    radius = float(np.sqrt(len(face) / np.pi)) if fit is None else fit.radius_mm
    column = _Column.build(cloud, turn, centre, radius)
    summit = column.climb(level, config.max_step_mm)
    if fit is not None and summit > level + config.max_step_mm:
        # the cluster held the flange or the flank only: the head goes on above it
        higher = _best_fit(cloud, turn, centre[None], summit, config)
        if higher is not None:
            fit, centre, radius, level = higher, higher.centre_mm, higher.radius_mm, summit
            column = _Column.build(cloud, turn, centre, radius)
    level, level_sigma = column.face_level(level, config.face_percentile)
    own: BoolArray = np.linalg.norm(local[:, :2] - centre, axis=1) <= 1.6 * radius + 0.5
    return Head(
        side=side,
        centre_mm=np.array([centre[0], centre[1], level]) @ turn,
        fit=fit,
        radius_mm=radius,
        probability=column.mean_of(column.probability, level),
        terminal_probability=column.mean_of(column.terminal_probability, level),
        face_coverage=column.face_coverage(level, radius),
        members=members[own] if own.any() else members,
        level_sigma_mm=level_sigma,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Column:
    """The outward-looking points within a head's radius, its own frame, sorted by height."""

    height: FloatArray
    across: FloatArray
    """Shape (N, 2), mm, from the axis."""
    facing: BoolArray
    probability: FloatArray
    terminal_probability: FloatArray

    @classmethod
    def build(
        cls, cloud: MotorCloud, turn: FloatArray, centre: FloatArray, radius: float
    ) -> _Column:
        index = np.array(cloud.columns.query_ball_point(centre @ turn[:2, :2], radius), np.int64)
        index = np.sort(index)
        local = cloud.points[index] @ turn
        normals = cloud.normals[index] @ turn
        across = local[:, :2] - centre
        # up or away from the axis: the head, not a wall around it nor the underside of an ear
        away = np.einsum("ni,ni->n", across, normals[:, :2]) > 0
        outward = (normals[:, 2] > 0.5) | (away & (normals[:, 2] > -0.5))
        index, local, across = index[outward], local[outward], across[outward]
        order = np.argsort(local[:, 2], kind="stable")
        return cls(
            height=local[order, 2],
            across=across[order],
            facing=(normals[outward, 2] > _FACING)[order],
            probability=cloud.probability[index[order]],
            terminal_probability=cloud.terminal_probability[index[order]],
        )

    def climb(self, level: float, max_step_mm: float) -> float:
        """Height of the highest face reachable from `level` without a gap in the surface."""
        above = self.height[self.height > level]
        gaps = np.flatnonzero(np.diff(above, prepend=level) > max_step_mm)
        top = above[: gaps[0]] if len(gaps) else above
        if len(top) == 0:
            return level
        faces = self.height[self.facing & (self.height <= top[-1]) & (self.height > level)]
        return float(np.percentile(faces[-12:], 50)) if len(faces) >= 12 else level

    def face_level(self, level: float, percentile: float) -> tuple[float, float]:
        """Height of the top face near `level`, and the roughness of the face (robust sigma)."""
        face = self.height[self.facing & (np.abs(self.height - level) < 1.0)]
        if len(face) < 5:
            return level, 0.5
        roughness = robust_sigma(face - np.median(face))
        return float(np.percentile(face, percentile)), roughness

    def mean_of(self, values: FloatArray, level: float) -> float:
        """Mean of values, shape (N,), over the head's upper part."""
        upper = (self.height < level + 0.5) & (self.height > level - 2.5)
        return float(values[upper].mean()) if upper.any() else 0.0

    def face_coverage(self, level: float, radius: float) -> float:
        """Share of 12 sectors in which the outer part of the face, or its dome, was seen."""
        distance = np.linalg.norm(self.across, axis=1)
        rim = (distance > 0.5 * radius) & (distance < 0.9 * radius)
        rim &= (self.height < level + 0.5) & (self.height > level - 2.0)
        turn = np.arctan2(self.across[rim, 1], self.across[rim, 0]) / np.pi + 1
        return len(np.unique(np.floor(turn * 6) % 12)) / 12


def _best_fit(
    cloud: MotorCloud, turn: FloatArray, starts: FloatArray, level: float, config: HeadConfig
) -> HeadFit | None:
    best = None
    for start in starts:
        fit = _fit_at(cloud, turn, start, level, config)
        if fit is None or fit.sigma_mm > config.max_fit_sigma_mm:
            continue
        if best is None or fit.score > best.score:
            best = fit
    return best


def _starts(local: FloatArray, config: HeadConfig) -> FloatArray:
    middle = local[:, :2].mean(axis=0)
    arm = local[:, :2] - middle
    if np.percentile(np.linalg.norm(arm, axis=1), 95) <= config.wide_cluster_mm:
        return middle[None]
    # farthest points first: spread over the cluster, the same ones every time
    chosen = [middle]
    distance = np.linalg.norm(arm, axis=1)
    while len(chosen) < 8 and distance.max() > 3.0:
        chosen.append(local[int(np.argmax(distance)), :2])
        distance = np.minimum(distance, np.linalg.norm(local[:, :2] - chosen[-1], axis=1))
    return np.stack(chosen)


def _fit_at(
    cloud: MotorCloud, turn: FloatArray, start: FloatArray, level: float, config: HeadConfig
) -> HeadFit | None:
    # a margin of two spacings, so that normals at the rim have all their neighbours
    reach = config.fit.radius_range_mm[1] + 3.0
    column = np.array(cloud.columns.query_ball_point(start @ turn[:2, :2], reach), dtype=np.int64)
    column = np.sort(column)
    local = cloud.points[column] @ turn - np.array([0.0, 0.0, level])
    near = (local[:, 2] > -config.fit.depth_mm[1] - 2.0) & (local[:, 2] < 2.5)
    if near.sum() < 20:
        return None
    local, coarse = local[near], cloud.normals[column[near]] @ turn
    normals = estimate_normals(local, config.normal_neighbours)
    same = np.einsum("ni,ni->n", normals, coarse)
    return fit_head(local, np.where(same[:, None] < 0, -normals, normals), start, config.fit)


def _side_of(cloud: MotorCloud, members: IntArray) -> Side:
    facing = cloud.normals[members, 2]
    top, bottom = int((facing > _FACING).sum()), int((facing < -_FACING).sum())
    if top != bottom:
        return Side.TOP if top > bottom else Side.BOTTOM
    return Side.TOP if float(cloud.points[members, 2].mean()) > 0 else Side.BOTTOM
