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
from boltpose.schema import Side

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

    def __post_init__(self) -> None:
        if not 0 < self.seed_probability < 1:
            raise ConfigError(f"seed_probability must be 0 to 1, got {self.seed_probability}")
        if not 0 < self.face_percentile <= 100:
            raise ConfigError(f"face_percentile must be 0 to 100, got {self.face_percentile}")
        if self.normal_neighbours < 4 or self.max_heads_per_cluster < 1:
            raise ConfigError("normal_neighbours must be >= 4, max_heads_per_cluster >= 1")
        if not self.wide_cluster_mm > 0:
            raise ConfigError(f"wide_cluster_mm must be > 0, got {self.wide_cluster_mm}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Head:
    """One candidate, measured in the frame of its side (motor, turned by 180 deg for bottom)."""

    side: Side
    centre_mm: FloatArray
    """Shape (3,), frame `motor`: on the axis, on the top face."""
    fit: HeadFit | None
    """None: neither flank nor cone was found; the centre is that of the face."""
    face_radius_mm: float
    """Radius of a disc with the area the facing points cover."""
    probability: float
    """Mean bolt probability of all outward points of the head's upper part."""
    members: IntArray
    """Indices of the cluster's points that belong to this head."""
    level_sigma_mm: float

    @property
    def radius_mm(self) -> float:
        """Of the flank, or of the face where no flank was found."""
        return self.face_radius_mm if self.fit is None else self.fit.radius_mm

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
    columns: KDTree
    """Over x and y: a head is a column of points."""

    @classmethod
    def build(cls, points: FloatArray, normals: FloatArray, probability: FloatArray) -> MotorCloud:
        """Index a cloud."""
        return cls(points, normals, probability, KDTree(points[:, :2]))


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
    sign = turn[2, 2]
    facing = sign * cloud.normals[members, 2] > _FACING
    local = cloud.points[members] @ turn
    face = local[facing] if facing.sum() >= 5 else local
    level = float(np.percentile(face[:, 2], config.face_percentile))
    fit = None
    for start in _starts(local, config):
        trial = _fit_at(cloud, turn, start, level, config)
        if trial is not None and (fit is None or trial.score > fit.score):
            fit = trial
    face_radius = float(np.sqrt(max(len(face), 1) / np.pi))
    centre = face[:, :2].mean(axis=0) if fit is None else fit.centre_mm
    radius = face_radius if fit is None else fit.radius_mm
    column = np.array(cloud.columns.query_ball_point((centre @ turn[:2, :2]), radius), np.int64)
    heights = sign * cloud.points[column, 2]
    level_sigma = 0.5
    up = sign * cloud.normals[column, 2] > _FACING
    up &= np.abs(heights - level) < 1.0
    if up.sum() >= 5:
        level = float(np.percentile(heights[up], config.face_percentile))
        level_sigma = float(robust_sigma(heights[up] - np.median(heights[up])))
    upper = column[(heights < level + 0.5) & (heights > level - 2.5)]
    outward = _looks_outward(cloud, upper, turn, centre)
    probability = float(cloud.probability[upper[outward]].mean()) if outward.any() else 0.0
    own: BoolArray = np.linalg.norm(local[:, :2] - centre, axis=1) <= 1.6 * radius + 0.5
    return Head(
        side=side,
        centre_mm=np.array([centre[0], centre[1], level]) @ turn,
        fit=fit,
        face_radius_mm=face_radius,
        probability=probability,
        members=members[own] if own.any() else members,
        level_sigma_mm=level_sigma,
    )


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


def _looks_outward(
    cloud: MotorCloud, index: IntArray, turn: FloatArray, centre: FloatArray
) -> BoolArray:
    """True where a normal looks up or away from the axis: head, not the wall around it."""
    normals = cloud.normals[index] @ turn
    arm = cloud.points[index] @ turn
    away = np.einsum("ni,ni->n", arm[:, :2] - centre, normals[:, :2])
    return (normals[:, 2] > 0.5) | (away > 0)


def _side_of(cloud: MotorCloud, members: IntArray) -> Side:
    facing = cloud.normals[members, 2]
    top, bottom = int((facing > _FACING).sum()), int((facing < -_FACING).sum())
    if top != bottom:
        return Side.TOP if top > bottom else Side.BOTTOM
    return Side.TOP if float(cloud.points[members, 2].mean()) > 0 else Side.BOTTOM
