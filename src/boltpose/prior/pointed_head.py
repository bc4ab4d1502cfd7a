"""The head a person points at: measured in the prior's own points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import ConfigError
from boltpose.prior.find_bolts import FindBoltsConfig, find_bolts
from boltpose.prior.heads import Head, MotorCloud, measure_head
from boltpose.schema import Part, Prior, PriorBolt, Side
from boltpose.segmentation.predictor import PARTS

FLANK_ONLY = "height as far down as its flank was seen: a flange or a deep seat is not in it"
"""Remark on a head without labels: its height may be 4 mm too small, its axis and top are right
(docs/prior-review.md)."""

_TURN = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class PointedHeadConfig:
    """How a head is measured where a person points."""

    reach_mm: float = 6.0
    """Points this near to a start are taken for the head at first: half an M6 head and a bit."""
    neighbourhood_mm: float = 40.0
    """No point farther from the click than this takes part: two M10 heads and their seats."""
    start_radii_mm: tuple[float, ...] = (2.5, 5.0)
    """The axis is also looked for this far to eight sides of the click: a person may hit a corner
    of the head."""
    rim_share: float = 1.2
    """A click up to this share of the head's radius from its axis means this head: the corners of
    a hexagon are 1.155 radii out."""
    rim_mm: float = 0.5
    """Added to it: half the spacing of the points."""
    above_mm: float = 2.0
    """A click this far above the top of a head does not mean it: a nut on a stud that was hit."""
    min_support: float = 1.5
    """Of the fit. With less, a fit is no better than the click itself; bare walls reach 1.2."""
    min_flank_sectors: int = 4
    """Of 12. A head without labels ends where its flank is seen in fewer: what goes on below is
    the motor beside it."""
    min_labelled_points: int = 60
    """From so many points labelled as bolt the labels say where the head ends; with fewer it is
    its flank. A head of 8 mm has about 100."""
    bolts: FindBoltsConfig = field(default_factory=FindBoltsConfig)

    def __post_init__(self) -> None:
        for name in (
            "reach_mm",
            "neighbourhood_mm",
            "rim_share",
            "rim_mm",
            "above_mm",
            "min_support",
        ):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if self.min_labelled_points < 1:
            raise ConfigError(f"min_labelled_points must be >= 1, got {self.min_labelled_points}")
        if not 1 <= self.min_flank_sectors <= 12:
            raise ConfigError(f"min_flank_sectors must be 1 to 12, got {self.min_flank_sectors}")
        if any(not radius > 0 for radius in self.start_radii_mm):
            raise ConfigError(f"start_radii_mm must be > 0, got {self.start_radii_mm}")


def measure_pointed_head(
    prior: Prior,
    click: FloatArray,
    config: PointedHeadConfig | None = None,
    *,
    side: Side | None = None,
) -> PriorBolt | None:
    """Measure the head at a point, as `find_bolts` would if its labels were certain.

    A first fit from several starts finds the axis; then all points of that head, and no others,
    are taken for the bolt, and the head is measured anew.

    Args:
        prior: The prior.
        click: Shape (3,), mm, frame `prior`: a point on the head, not necessarily its middle.
        config: Settings.
        side: Heads that look to this side only; by default whichever the surface looks to.

    Returns:
        The bolt, without an id, sure or with the reasons why not; None where no flank or cone of
        a head is found that the point belongs to.
    """
    config = config or PointedHeadConfig()
    near = np.linalg.norm(prior.points - click, axis=1) < config.neighbourhood_mm
    points, normals = prior.points[near], prior.normals[near]
    motor_from_prior = prior.alignment.prior_from_motor.inverse()
    shares = np.zeros((len(points), len(PARTS)))
    shares[:, PARTS.index(Part.CONNECTOR)] = 1.0
    cloud = MotorCloud.build(
        motor_from_prior.apply(points), motor_from_prior.rotate(normals), shares
    )
    spot = motor_from_prior.apply(click)
    head = _best_head(cloud, spot, config, side)
    if head is None:
        return None
    labelled = _labelled(cloud, prior.labels[near] == Part.BOLT, head)
    has_labels = int(labelled.sum()) >= config.min_labelled_points
    members = labelled if has_labels else _down_the_flank(cloud, head, config)
    shares[members] = 0.0
    shares[members, PARTS.index(Part.BOLT)] = 1.0
    bolts = replace(config.bolts, hough=replace(config.bolts.hough, max_candidates=0))
    found = find_bolts(points, normals, shares, prior.alignment, bolts)
    meant = next((bolt for bolt in found if _is_meant(bolt, click, config, side)), None)
    if meant is None or has_labels:
        return meant
    return replace(meant, remarks=(*meant.remarks, FLANK_ONLY))


def _best_head(
    cloud: MotorCloud, spot: FloatArray, config: PointedHeadConfig, side: Side | None
) -> Head | None:
    best: Head | None = None
    for start in _starts(spot, config):
        offered = np.linalg.norm(cloud.points - start, axis=1) < config.reach_mm
        if side is not None:
            offered &= cloud.normals[:, 2] * (1 if side is Side.TOP else -1) > 0
        members = np.flatnonzero(offered)
        if len(members) < 10:
            continue
        head = measure_head(cloud, members, config.bolts.heads)
        if head.fit is None or (side is not None and head.side is not side):
            continue
        beside = float(np.linalg.norm(head.centre_mm[:2] - spot[:2]))
        if beside > config.rim_share * head.radius_mm + config.rim_mm:
            continue
        if best is None or best.fit is None or head.fit.score > best.fit.score:
            best = head
    return best


def _starts(spot: FloatArray, config: PointedHeadConfig) -> list[FloatArray]:
    """The click and eight points around it at each distance, across the axis."""
    angles = np.arange(8) * np.pi / 4
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(8)])
    return [spot, *(spot + radius * arm for radius in config.start_radii_mm for arm in around)]


def _labelled(cloud: MotorCloud, is_bolt: BoolArray, head: Head) -> BoolArray:
    """Which of the points labelled as bolt are this head's."""
    local, _ = _in_head(cloud, head)
    # as wide as `measure_head` looks: a flange, or a washer
    return is_bolt & _about(local, head) & (_across(local) <= 1.6 * head.radius_mm + 0.5)


def _down_the_flank(cloud: MotorCloud, head: Head, config: PointedHeadConfig) -> BoolArray:
    """Which points are the head's where no labels say so: all from its top to its flank's end.

    The flank says where a head ends, in a counterbore and on an uneven casting too. The surface
    around the head does not: it may lie higher than its seat.
    """
    local, normals = _in_head(cloud, head)
    across = _across(local)
    outward = (local[:, :2] * normals[:, :2]).sum(axis=1) / np.maximum(across, 1e-9)
    column = _about(local, head) & (across < config.rim_share * head.radius_mm + config.rim_mm)
    # corners of a hexagon are 1.155 radii out; a boss under the head is wider
    flank = column & (outward > 0.5)
    flank &= (across > 0.7 * head.radius_mm) & (across < 1.16 * head.radius_mm + 0.3)
    end = _end_of_flank(local[flank], config)
    if end is None:
        end = 0.8 * head.radius_mm  # hexagon heads, ISO 4017
    # what looks inwards is the wall of a counterbore
    is_wall = (outward < -0.3) & (local[:, 2] < -1.0)
    return column & (local[:, 2] > -end) & ~is_wall


def _end_of_flank(flank: FloatArray, config: PointedHeadConfig) -> float | None:
    """How far below the top a flank is seen around, mm; None where next to nothing is seen."""
    depths = -flank[:, 2]
    sectors = np.floor(np.arctan2(flank[:, 1], flank[:, 0]) / np.pi * 6)
    slices = np.floor(depths)  # 1 mm each: a scan has a point every 1 mm
    last = 0
    while len(np.unique(sectors[slices == last + 1])) >= config.min_flank_sectors:
        last += 1
    own = depths[slices <= last]
    return float(np.percentile(own, 97)) if len(own) >= 10 else None


def _in_head(cloud: MotorCloud, head: Head) -> tuple[FloatArray, FloatArray]:
    """Points and normals, shape (N, 3) each, seen from the head's top, +z out of it."""
    turn = np.eye(3) if head.side is Side.TOP else _TURN
    return (cloud.points - head.centre_mm) @ turn, cloud.normals @ turn


def _across(local: FloatArray) -> FloatArray:
    return np.linalg.norm(local[:, :2], axis=1)


def _about(local: FloatArray, head: Head) -> BoolArray:
    """From a little above the top to deeper than any head reaches."""
    return (local[:, 2] < 1.0) & (local[:, 2] > -2.5 * head.radius_mm)


def _is_meant(
    bolt: PriorBolt, click: FloatArray, config: PointedHeadConfig, side: Side | None
) -> bool:
    x, y, z = bolt.prior_from_bolt.inverse().apply(click)
    rim = config.rim_share * bolt.head_diameter_mm / 2 + config.rim_mm
    return (
        side in (None, bolt.side)
        and bolt.head_fit_support >= config.min_support
        and float(np.hypot(x, y)) <= rim
        and -1.5 * bolt.head_height_mm - config.above_mm <= z <= config.above_mm
    )
