"""A person's check of a prior: add a bolt that was missed, remove what is none, confirm one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray, as_points
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.prior.alignment import bolt_rotation
from boltpose.prior.find_bolts import FindBoltsConfig, find_bolts
from boltpose.schema import Part, Prior, PriorBolt, Side
from boltpose.segmentation.predictor import PARTS

ADDED = "added by a person"
CONFIRMED = "confirmed by a person"


@dataclass(frozen=True, slots=True, kw_only=True)
class EditConfig:
    """How far a person's click may be from the head it means."""

    reach_mm: float = 6.0
    """Points this near to the click are offered to the head fit: half an M6 head and a bit."""
    surface_mm: float = 5.0
    """A click farther than this from every scan point is refused: wrong frame or unit."""
    unfitted_sigma_mm: float = 1.0
    """1 sigma of a position that rests on the click alone: a careful hand on a screen."""
    nominal_diameter_mm: float = 10.0
    """Head diameter noted when no head could be fitted (M6 spanner size)."""
    bolts: FindBoltsConfig = field(default_factory=FindBoltsConfig)

    def __post_init__(self) -> None:
        for name in ("reach_mm", "surface_mm", "unfitted_sigma_mm", "nominal_diameter_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")


def add_bolt(prior: Prior, position: npt.ArrayLike, config: EditConfig | None = None) -> Prior:
    """Add the bolt at a point, snapped to the head found there.

    Where no head can be fitted the click itself is taken: the person has seen the bolt. The
    remark says so and the sigma is that of a click.

    Args:
        prior: The prior.
        position: Shape (3,), mm, frame `prior`: a point on the head.
        config: Settings.

    Returns:
        The prior with one bolt more; ids of the others do not change.

    Raises:
        ConfigError: The point lies off the surface, or on a bolt the prior already has.
    """
    config = config or EditConfig()
    click = as_points(np.atleast_2d(np.asarray(position, dtype=np.float64)), "position")[0]
    distance = np.linalg.norm(prior.points - click, axis=1)
    where = ",".join(f"{value:g}" for value in click)
    if distance.min() > config.surface_mm:
        raise ConfigError(
            f"no surface at {where}: the nearest scan point is {distance.min():.1f} mm away, "
            f"wanted at most {config.surface_mm} mm; is it in mm in the scan's own frame?"
        )
    bolt = _fit_at(prior, distance, config) or _place_at(prior, click, distance, config)
    for other in prior.bolts:
        gap = np.linalg.norm(
            other.prior_from_bolt.translation_mm - bolt.prior_from_bolt.translation_mm
        )
        if gap < max(other.head_diameter_mm, bolt.head_diameter_mm) / 2:
            raise ConfigError(f"bolt {other.id} is already at {where} ({gap:.1f} mm beside)")
    bolt = replace(bolt, id=_free_id(prior, bolt.side))
    return replace(prior, bolts=_ordered((*prior.bolts, bolt)))


def remove_bolt(prior: Prior, bolt_id: str) -> Prior:
    """Remove a bolt; ids of the others do not change.

    Raises:
        ConfigError: There is no bolt of that id.
    """
    _require(prior, bolt_id)
    return replace(prior, bolts=tuple(bolt for bolt in prior.bolts if bolt.id != bolt_id))


def confirm_bolt(prior: Prior, bolt_id: str) -> Prior:
    """Mark a bolt as seen by a person: it is sure from now on, its sigmas stay as measured.

    Raises:
        ConfigError: There is no bolt of that id.
    """
    _require(prior, bolt_id)

    def confirmed(bolt: PriorBolt) -> PriorBolt:
        remarks = tuple(dict.fromkeys((*bolt.remarks, CONFIRMED)))
        return replace(bolt, is_sure=True, confidence=1.0, remarks=remarks)

    return replace(
        prior,
        bolts=tuple(confirmed(bolt) if bolt.id == bolt_id else bolt for bolt in prior.bolts),
    )


def _require(prior: Prior, bolt_id: str) -> None:
    ids = [bolt.id for bolt in prior.bolts]
    if bolt_id not in ids:
        raise ConfigError(f"no bolt '{bolt_id}' in prior '{prior.name}', there are {ids}")


def _fit_at(prior: Prior, distance: FloatArray, config: EditConfig) -> PriorBolt | None:
    """The head nearest to the click, found as `find_bolts` finds one whose labels are certain."""
    probabilities = np.zeros((len(prior.points), len(PARTS)))
    probabilities[:, PARTS.index(Part.CONNECTOR)] = 1.0
    near = distance < config.reach_mm
    probabilities[near] = 0.0
    probabilities[near, PARTS.index(Part.BOLT)] = 1.0
    found = find_bolts(prior.points, prior.normals, probabilities, prior.alignment, config.bolts)
    if not found or not found[0].is_sure:
        return None
    return replace(found[0], confidence=1.0, remarks=(ADDED,))


def _place_at(
    prior: Prior, click: FloatArray, distance: FloatArray, config: EditConfig
) -> PriorBolt:
    near = distance < config.surface_mm
    motor_z = prior.alignment.prior_from_motor.z_axis
    side = Side.TOP if float((prior.normals[near] @ motor_z).sum()) >= 0 else Side.BOTTOM
    return PriorBolt(
        id="",
        side=side,
        prior_from_bolt=Transform.from_parts(
            "prior", "bolt", bolt_rotation(side, prior.alignment), click
        ),
        cluster_centre=click,
        head_diameter_mm=config.nominal_diameter_mm,
        head_height_mm=0.4 * config.nominal_diameter_mm,  # hexagon heads, ISO 4017
        point_count=int(near.sum()),
        class_probability=1.0,
        head_fit_support=0.0,
        sigma_lateral_mm=config.unfitted_sigma_mm,
        sigma_axial_mm=config.unfitted_sigma_mm,
        is_sure=True,
        remarks=(f"{ADDED}, no head could be fitted: the point given is used as it is",),
    )


def _free_id(prior: Prior, side: Side) -> str:
    letter = "T" if side is Side.TOP else "B"
    taken = {bolt.id for bolt in prior.bolts}
    return next(f"{letter}{k}" for k in range(1, len(taken) + 2) if f"{letter}{k}" not in taken)


def _ordered(bolts: tuple[PriorBolt, ...]) -> tuple[PriorBolt, ...]:
    """Top bolts first, then by number; a removed number stays free until it is needed."""
    return tuple(sorted(bolts, key=lambda b: (b.side is Side.BOTTOM, len(b.id), b.id)))
