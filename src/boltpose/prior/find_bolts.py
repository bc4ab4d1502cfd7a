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
from boltpose.prior.heads import Head, HeadConfig, MotorCloud, find_heads
from boltpose.schema import Alignment, Part, PriorBolt, Side

_FIRST_ANGLE_RAD = np.deg2rad(-10.0)
"""Numbering starts a little before +y: a bolt on the y axis is the first, whatever its noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FindBoltsConfig:
    """Which measured heads are bolts, and which of them are sure.

    The network or the shape must be convincing: the class probability asked for falls linearly
    from `min_probability_unsupported` without any head fit to none at `full_support` (a cluster
    of bolt points is there anyway, else nothing would have been fitted).
    """

    heads: HeadConfig = field(default_factory=HeadConfig)
    min_probability_unsupported: float = 0.75
    full_support: float = 8.0
    """Head-fit support from which the shape alone is convincing. On reman18 (simulated) no false
    candidate of three networks, each blind for the motor's family, had more than 4.2."""
    min_face_coverage: float = 0.5
    """Share of the turn in which the head must have a face or dome below its flank's radius."""
    min_diameter_mm: float = 5.0
    """Spanner size of an M3 bolt less a little."""
    sure_diameter_mm: float = 6.5
    """Spanner size of an M4 bolt less a little; smaller ones may be bosses of a casting."""
    sure_probability: float = 0.6
    """Mean class probability from which a bolt may be sure."""
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
    sigma_unfitted_mm: float = 1.0
    """Lateral sigma of the middle of a top face, where no flank was found."""
    sigma_level_mm: float = 0.05
    """Of the height of a top face; plus the roughness of the face itself."""

    def __post_init__(self) -> None:
        for name in ("min_probability_unsupported", "min_face_coverage", "sure_probability"):
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
    bolts = [_as_bolt(head, cloud, bolt_share, alignment, settings) for head in drop_doubles(heads)]
    return number_bolts(bolts, alignment)


def _is_bolt(head: Head, config: FindBoltsConfig) -> bool:
    if 2 * head.radius_mm < config.min_diameter_mm:
        return False
    if head.fit is None and 2 * head.radius_mm < config.sure_diameter_mm:
        return False
    if head.face_coverage < config.min_face_coverage:
        return False
    # a nut on a terminal has the shape of a head, and only its class tells it from a bolt
    if head.terminal_probability > max(0.5, head.probability):
        return False
    missing = max(1.0 - head.support / config.full_support, 0.0)
    return head.probability >= config.min_probability_unsupported * missing


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
    sigma = config.sigma_unfitted_mm
    if head.fit is not None:
        noise = np.hypot(config.sigma_scale * head.fit.sigma_mm, config.sigma_floor_mm)
        bias = config.sigma_bias_mm / max(head.support, 0.1)
        sigma = min(float(np.hypot(noise, bias)), config.sigma_unfitted_mm)
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
