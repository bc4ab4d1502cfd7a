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
    seat_mm: float = 2.5
    """Width of the ring around the head in which the surface it sits on is looked for."""
    min_labelled_points: int = 60
    """From so many points labelled as bolt the labels say where the head ends; with fewer it is
    the surface around it. A head of 8 mm has about 100."""
    bolts: FindBoltsConfig = field(default_factory=FindBoltsConfig)

    def __post_init__(self) -> None:
        for name in (
            "reach_mm",
            "neighbourhood_mm",
            "rim_share",
            "rim_mm",
            "above_mm",
            "min_support",
            "seat_mm",
        ):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if self.min_labelled_points < 1:
            raise ConfigError(f"min_labelled_points must be >= 1, got {self.min_labelled_points}")
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
    members = _members(cloud, prior.labels[near] == Part.BOLT, head, config)
    shares[members] = 0.0
    shares[members, PARTS.index(Part.BOLT)] = 1.0
    bolts = replace(config.bolts, hough=replace(config.bolts.hough, max_candidates=0))
    found = find_bolts(points, normals, shares, prior.alignment, bolts)
    return next((bolt for bolt in found if _is_meant(bolt, click, config, side)), None)


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


def _members(
    cloud: MotorCloud, is_bolt: BoolArray, head: Head, config: PointedHeadConfig
) -> BoolArray:
    """Which points are the head's: those labelled so, else all from its top to its seat."""
    turn = np.eye(3) if head.side is Side.TOP else _TURN
    local = (cloud.points - head.centre_mm) @ turn
    normals = cloud.normals @ turn
    across = np.linalg.norm(local[:, :2], axis=1)
    above = (local[:, 2] < 1.0) & (local[:, 2] > -2.5 * head.radius_mm)
    # as wide as `measure_head` looks: a flange, or a washer
    labelled = is_bolt & above & (across <= 1.6 * head.radius_mm + 0.5)
    if labelled.sum() >= config.min_labelled_points:
        return labelled
    rim = config.rim_share * head.radius_mm + config.rim_mm
    # the ring around the head looks the same way as its face, but lies deeper
    ring = above & (across > rim) & (across < rim + config.seat_mm)
    ring &= (normals[:, 2] > 0.8) & (local[:, 2] < -1.0)
    # 0.8 radii: hexagon heads, ISO 4017
    seat = float(np.percentile(local[ring, 2], 75)) if ring.sum() >= 10 else -0.8 * head.radius_mm
    return above & (across < rim) & (local[:, 2] > seat)


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
