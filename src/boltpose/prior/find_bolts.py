"""Full scan with class probabilities -> every bolt of the motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, as_points
from boltpose.errors import ConfigError, ShapeError
from boltpose.geometry.transforms import Transform
from boltpose.prior.alignment import bolt_rotation
from boltpose.prior.confidence import (
    ConfidenceConfig,
    bolt_probability,
    placement_probability,
)
from boltpose.prior.head_hough import HoughConfig, propose_heads
from boltpose.prior.heads import Head, HeadConfig, MotorCloud, find_heads, measure_head
from boltpose.schema import Alignment, Part, PriorBolt, Side

_FIRST_ANGLE_RAD = np.deg2rad(-10.0)
"""Numbering starts a little before +y: a bolt on the y axis is the first, whatever its noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FindBoltsConfig:
    """Which measured heads are bolts, and which of them are sure.

    All evidence together or the shape alone must be convincing.
    """

    heads: HeadConfig = field(default_factory=HeadConfig)
    hough: HoughConfig = field(default_factory=HoughConfig)
    """Second opinion, from the shape alone; `max_candidates=0` turns it off."""
    confidence: ConfidenceConfig = field(default_factory=ConfidenceConfig)
    min_bolt_probability: float = 0.25
    """Probability from which a head counts as a bolt; a miss costs more than a false bolt that a
    person looks at once. On motors of the factory that the networks had not seen, 0.2 lets 5 more
    false ones in and finds none more (292 of 305 true, 20 false here)."""
    full_support: float = 18.0
    """Head-fit support from which the shape of a cluster's head is convincing by itself. On motors
    of the factory 3 of 187 false candidates have more."""
    min_probability_proposed: float = 0.15
    """Mean class probability of a head that was proposed by its shape and not by its labels. On
    reman18 (simulated) studs and shaft ends proposed so had at most 0.08."""
    min_face_coverage: float = 0.5
    """Share of the turn in which the head must have a face or dome below its flank's radius."""
    min_diameter_mm: float = 5.0
    """Spanner size of an M3 bolt less a little."""
    sure_diameter_mm: float = 6.5
    """Spanner size of an M4 bolt less a little; smaller ones may be bosses of a casting."""
    sure_probability: float = 0.6
    """Mean class probability from which a bolt may be sure."""
    sure_confidence: float = 0.8
    """Confidence from which a bolt may be sure. On motors of the factory that the networks had not
    seen every false bolt as large as M4 stayed below."""
    sure_support: float = 4.0
    """Head-fit support from which a bolt may be sure."""
    sure_sigma_mm: float = 0.2
    """Lateral sigma up to which a bolt may be sure: 0.5 mm is then 2.5 sigma."""
    sigma_scale: float = 1.5
    """Of the fit's own sigma; its octants are not quite independent."""
    sigma_floor_mm: float = 0.03
    """Lateral error that the fit cannot see (relief of rust, registration of strips)."""
    sigma_bias_mm: float = 0.4
    """Divided by the support: where little flank is seen, other surfaces pull the fit."""
    sigma_rival_share: float = 0.5
    """Of the distance to a rival optimum of the fit: the truth may be at either."""
    sigma_unfitted_mm: float = 1.0
    """Lateral sigma of the middle of a top face, where no flank was found."""
    sigma_level_mm: float = 0.05
    """Of the height of a top face; plus the roughness of the face itself."""

    def __post_init__(self) -> None:
        for name in (
            "min_bolt_probability",
            "min_probability_proposed",
            "min_face_coverage",
            "sure_probability",
            "sure_confidence",
        ):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be 0 to 1, got {getattr(self, name)}")
        for name in (
            "full_support",
            "min_diameter_mm",
            "sure_diameter_mm",
            "sure_support",
            "sure_sigma_mm",
            "sigma_scale",
            "sigma_floor_mm",
            "sigma_bias_mm",
            "sigma_rival_share",
            "sigma_unfitted_mm",
            "sigma_level_mm",
        ):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")


def find_bolts(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    probabilities: npt.ArrayLike,
    alignment: Alignment,
    config: FindBoltsConfig | None = None,
) -> tuple[PriorBolt, ...]:
    """Find every bolt of a motor in its full scan.

    Args:
        points: Shape (N, 3), mm, frame `prior`.
        normals: Shape (N, 3), unit, outward.
        probabilities: Shape (N, 6), of the classes 1 to 6 of `Part`.
        alignment: The motor's axes.
        config: Settings.

    Returns:
        The bolts, top ones first, numbered by their angle around z from +y, then outward.

    Raises:
        ShapeError: The arrays do not belong together, or a value is not finite.

    Source:
        Paper, section 3.4, for clusters and their centres; sides and heads are ours.
    """
    settings = config or FindBoltsConfig()
    cloud = as_points(points, "points")
    outward = as_points(normals, "normals")
    share = np.asarray(probabilities, dtype=np.float64)
    if outward.shape != cloud.shape or share.shape != (len(cloud), 6):
        raise ShapeError(
            f"normals must be {cloud.shape} and probabilities ({len(cloud)}, 6), "
            f"got {outward.shape} and {share.shape}"
        )
    if not np.isfinite(share).all():
        raise ShapeError("probabilities must be finite")
    bolt_share = share[:, int(Part.BOLT) - 1]
    motor_from_prior = alignment.prior_from_motor.inverse()
    motor = MotorCloud.build(motor_from_prior.apply(cloud), motor_from_prior.rotate(outward), share)
    heads = [head for head in find_heads(motor, settings.heads) if _is_bolt(head, settings)]
    heads += _overlooked(motor, heads, settings)
    bolts = [_as_bolt(head, cloud, bolt_share, alignment, settings) for head in drop_doubles(heads)]
    return number_bolts(bolts, alignment)


def may_be_bolt(head: Head, config: FindBoltsConfig) -> bool:
    """Whether a head has the size and the face of one and is no terminal's nut."""
    if 2 * head.radius_mm < config.min_diameter_mm:
        return False
    if head.fit is None and 2 * head.radius_mm < config.sure_diameter_mm:
        return False
    if head.face_coverage < config.min_face_coverage:
        return False
    # a nut on a terminal has the shape of a head, and only its class tells it from a bolt
    return head.terminal_probability <= max(0.5, head.probability)


def _is_bolt(head: Head, config: FindBoltsConfig) -> bool:
    if not may_be_bolt(head, config):
        return False
    if head.support >= config.full_support:
        return True
    sigma = lateral_sigma_mm(head, config)
    return bolt_probability(head, sigma, config.confidence) >= config.min_bolt_probability


def lateral_sigma_mm(head: Head, config: FindBoltsConfig) -> float:
    """1 sigma of a head's place beside its axis."""
    if head.fit is None:
        return config.sigma_unfitted_mm
    noise = np.hypot(config.sigma_scale * head.fit.sigma_mm, config.sigma_floor_mm)
    bias = config.sigma_bias_mm / max(head.support, 0.1)
    rival = config.sigma_rival_share * head.fit.rival_mm
    return min(float(np.hypot(np.hypot(noise, bias), rival)), config.sigma_unfitted_mm)


def _overlooked(motor: MotorCloud, known: Sequence[Head], config: FindBoltsConfig) -> list[Head]:
    """Heads the labels missed: their shape is convincing and the network did not rule them out."""
    found: list[Head] = []
    for face in propose_heads(motor, config.hough):
        middle = motor.points[face, :2].mean(axis=0)
        if any(np.linalg.norm(middle - head.centre_mm[:2]) < head.radius_mm for head in known):
            continue
        head = measure_head(motor, face, config.heads)
        if (
            _is_bolt(head, config)
            and head.support >= config.full_support
            and head.probability >= config.min_probability_proposed
            and 2 * head.radius_mm >= config.sure_diameter_mm
        ):
            found.append(head)
    return found


def drop_doubles(heads: Sequence[Head]) -> list[Head]:
    """Keep the best of heads that would overlap: two bolts cannot share a place."""
    kept: list[Head] = []

    # the more convincing first; the place decides between equals
    def rank(head: Head) -> tuple[float, ...]:
        return (-head.probability * min(head.support, 20.0), *head.centre_mm.tolist())

    for head in sorted(heads, key=rank):
        for other in kept:
            apart = float(np.linalg.norm(head.centre_mm[:2] - other.centre_mm[:2]))
            deep = abs(float(head.centre_mm[2] - other.centre_mm[2]))
            touching = 0.8 * (head.radius_mm + other.radius_mm)
            if head.side is other.side and apart < touching and deep < 10.0:
                break
        else:
            kept.append(head)
    return kept


def _as_bolt(
    head: Head,
    cloud: FloatArray,
    bolt_share: FloatArray,
    alignment: Alignment,
    config: FindBoltsConfig,
) -> PriorBolt:
    sigma = lateral_sigma_mm(head, config)
    confidence = bolt_probability(head, sigma, config.confidence) * placement_probability(sigma)
    remarks: list[str] = []
    if head.fit is None:
        remarks.append("no flank seen: centre of the top face")
    elif head.support < config.sure_support:
        remarks.append(f"little flank seen (support {head.support:.1f})")
    if 2 * head.radius_mm < config.sure_diameter_mm:
        remarks.append(f"small for a bolt ({2 * head.radius_mm:.1f} mm): a boss?")
    if head.probability < config.sure_probability:
        remarks.append(f"the network doubts it (bolt probability {head.probability:.2f})")
    if sigma > config.sure_sigma_mm:
        remarks.append(f"axis uncertain by {sigma:.2f} mm")
    if not remarks and confidence < config.sure_confidence:
        remarks.append(f"all in all not convincing (confidence {confidence:.2f})")
    members = head.members[bolt_share[head.members] >= 0.5]
    if len(members) == 0:
        members = head.members
    top = alignment.prior_from_motor.apply(head.centre_mm)
    rotation = bolt_rotation(head.side, alignment)
    depth = (top - cloud[members]) @ rotation[:, 2]
    return PriorBolt(
        id="",
        side=head.side,
        prior_from_bolt=Transform.from_parts(
            "prior",
            "bolt",
            rotation,
            top,
        ),
        cluster_centre=cloud[members].mean(axis=0),
        head_diameter_mm=2 * head.radius_mm,
        # the lowest labelled points, but for strays: right to 0.06 mm in the median (simulated)
        head_height_mm=max(0.5, float(np.percentile(depth, 95))),
        point_count=len(members),
        class_probability=head.probability,
        head_fit_support=head.support,
        sigma_lateral_mm=sigma,
        sigma_axial_mm=float(np.hypot(head.level_sigma_mm, config.sigma_level_mm)),
        confidence=confidence,
        is_sure=not remarks,
        remarks=tuple(remarks),
    )


def number_bolts(bolts: Sequence[PriorBolt], alignment: Alignment) -> tuple[PriorBolt, ...]:
    """Name bolts T1, T2, ... and B1, B2, ... by their angle around z from +y, then outward.

    The angle grows from +y towards -x, and counts in steps of 0.6 deg so that bolts in line
    with the axis are ordered by their distance from it.
    """
    motor_from_prior = alignment.prior_from_motor.inverse()

    def place(bolt: PriorBolt) -> tuple[float, float]:
        x, y, _ = motor_from_prior.apply(bolt.prior_from_bolt.translation_mm)
        angle = (float(np.arctan2(-x, y)) - _FIRST_ANGLE_RAD) % (2 * np.pi)
        return round(angle, 2), float(np.hypot(x, y))

    result: list[PriorBolt] = []
    for side, letter in ((Side.TOP, "T"), (Side.BOTTOM, "B")):
        ordered = sorted((bolt for bolt in bolts if bolt.side is side), key=place)
        result += [replace(bolt, id=f"{letter}{k}") for k, bolt in enumerate(ordered, start=1)]
    return tuple(result)
