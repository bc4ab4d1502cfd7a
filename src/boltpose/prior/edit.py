"""A person's check of a prior: add a missed bolt, remove what is none, confirm one, flip one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from boltpose.arrays import FloatArray, as_points
from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.prior.alignment import bolt_rotation
from boltpose.prior.confidence import placement_probability
from boltpose.prior.pointed_head import PointedHeadConfig, measure_pointed_head
from boltpose.schema import Prior, PriorBolt, Side

ADDED = "added by a person"
CONFIRMED = "confirmed by a person"
FLIPPED = "turned to the other side by a person"

_BACK_FACING = -0.2
"""Mean of the scan's normals at a head along the bolt's axis: 0.38 to 0.9 for the 160 bolts of
reman18 (simulated), the same with a minus when they are flipped."""
_FEWEST_NORMALS = 20
"""Fewer points of a head say nothing about where it looks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EditConfig:
    """How far a person's click may be from the head it means."""

    surface_mm: float = 5.0
    """A click farther than this from every scan point is refused: wrong frame or unit."""
    unfitted_sigma_mm: float = 1.0
    """1 sigma of a position that rests on the click alone: a careful hand on a screen."""
    nominal_diameter_mm: float = 10.0
    """Head diameter noted when no head could be fitted (M6 spanner size)."""
    head: PointedHeadConfig = field(default_factory=PointedHeadConfig)

    def __post_init__(self) -> None:
        for name in ("surface_mm", "unfitted_sigma_mm", "nominal_diameter_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")


def add_bolt(prior: Prior, position: npt.ArrayLike, config: EditConfig | None = None) -> Prior:
    """Add the bolt at a point, snapped to the head found there.

    The point may be anywhere on the head. Where the head's shape is measured well the bolt is
    sure. Where it is measured badly, or where no head can be fitted and the click itself is
    taken, the bolt is unsure, the remark says why, and a person has to confirm what came out.

    Args:
        prior: The prior.
        position: Shape (3,), mm, frame `prior`: a point on the head.
        config: Settings.

    Returns:
        The prior with one bolt more; ids of the others do not change.

    Raises:
        ConfigError: The point lies off the surface, or on a bolt the prior already has.
        ShapeError: It is not three finite numbers.
    """
    config = config or EditConfig()
    click = as_points(np.atleast_2d(np.asarray(position, dtype=np.float64)), "position")[0]
    distance = np.linalg.norm(prior.points - click, axis=1)
    where = ",".join(f"{value:g}" for value in click)
    if not distance.min(initial=np.inf) <= config.surface_mm:
        raise ConfigError(
            f"no surface at {where}: the nearest scan point is {distance.min():.1f} mm away, "
            f"wanted at most {config.surface_mm} mm; is it in mm in the scan's own frame?"
        )
    # one BLAS thread: sums in another order give other bits
    with threadpool_limits(1, user_api="blas"):
        bolt = measure_pointed_head(prior, click, config.head)
    bolt = _place_at(prior, click, distance, config) if bolt is None else _vouched(bolt, ADDED)
    _require_room(prior, bolt, where)
    bolt = replace(bolt, id=_free_id(prior, bolt.side))
    return replace(prior, bolts=_ordered((*prior.bolts, bolt)))


def remove_bolt(prior: Prior, bolt_id: str) -> Prior:
    """Remove a bolt; ids of the others do not change.

    Raises:
        ConfigError: There is no bolt of that id.
    """
    require_bolt(prior, bolt_id)
    return replace(prior, bolts=tuple(bolt for bolt in prior.bolts if bolt.id != bolt_id))


def confirm_bolt(prior: Prior, bolt_id: str) -> Prior:
    """Mark a bolt as seen by a person: it is sure from now on, its sigmas stay as measured.

    Raises:
        ConfigError: There is no bolt of that id, or the scan shows its head looking the other way:
            the tool would come through the motor.
    """
    if _looks_back(prior, require_bolt(prior, bolt_id)):
        raise ConfigError(
            f"{bolt_id} cannot be confirmed: the scan shows a head there that looks the other "
            "way, so the tool would come through the motor; flip it, or remove it"
        )

    def confirmed(bolt: PriorBolt) -> PriorBolt:
        remarks = tuple(dict.fromkeys((*bolt.remarks, CONFIRMED)))
        return replace(bolt, is_sure=True, confidence=1.0, remarks=remarks)

    return change_bolt(prior, bolt_id, confirmed)


def flip_bolt(prior: Prior, bolt_id: str, config: EditConfig | None = None) -> Prior:
    """Turn a bolt so that its head looks the other way: top becomes bottom, bottom becomes top.

    The bolt is turned by 180 degrees about the middle of its head, across the axis. The head
    stays where it is; `head_top`, where the tool lands, moves to the head's other face, and +z
    points out of that face. If the scan shows a head that looks that way, it is measured and its
    pose taken. If not, the turned pose is a guess along the axis: the bolt is unsure, until a
    person confirms it.

    The id changes with the side, as ids say the side; name, tool and order stay.

    Args:
        prior: The prior.
        bolt_id: The bolt.
        config: Settings.

    Returns:
        The prior with that bolt turned; ids of the others do not change.

    Raises:
        ConfigError: There is no bolt of that id, or another bolt is already where it would be.
    """
    config = config or EditConfig()
    bolt = require_bolt(prior, bolt_id)
    turned = _turned(bolt, config)
    others = replace(prior, bolts=tuple(other for other in prior.bolts if other.id != bolt_id))
    with threadpool_limits(1, user_api="blas"):
        measured = measure_pointed_head(
            others, turned.prior_from_bolt.translation_mm, config.head, side=turned.side
        )
    if measured is not None:
        turned = replace(
            _vouched(measured, FLIPPED), name=bolt.name, tool=bolt.tool, order=bolt.order
        )
    _require_room(others, turned, f"the other side of {bolt_id}")
    # the number of an id may be taken on the other side
    turned = replace(turned, id=_free_id(others, turned.side))
    return replace(prior, bolts=_ordered((*others.bolts, turned)))


def require_bolt(prior: Prior, bolt_id: str) -> PriorBolt:
    """Return the bolt of that id.

    Raises:
        ConfigError: There is none; the text names those there are.
    """
    for bolt in prior.bolts:
        if bolt.id == bolt_id:
            return bolt
    ids = [bolt.id for bolt in prior.bolts]
    raise ConfigError(f"no bolt '{bolt_id}' in prior '{prior.name}', there are {ids}")


def change_bolt(prior: Prior, bolt_id: str, change: Callable[[PriorBolt], PriorBolt]) -> Prior:
    """Return the prior with one bolt replaced, in its place.

    Raises:
        ConfigError: There is no bolt of that id.
    """
    require_bolt(prior, bolt_id)
    return replace(
        prior, bolts=tuple(change(bolt) if bolt.id == bolt_id else bolt for bolt in prior.bolts)
    )


def _looks_back(prior: Prior, bolt: PriorBolt) -> bool:
    """Whether the surface of the head, measured from outside, faces against the bolt's axis."""
    local = bolt.prior_from_bolt.inverse().apply(prior.points)
    on_head = np.hypot(local[:, 0], local[:, 1]) < bolt.head_diameter_mm / 2 + 0.5
    on_head &= (local[:, 2] < 1.0) & (local[:, 2] > -bolt.head_height_mm - 1.0)
    if int(on_head.sum()) < _FEWEST_NORMALS:
        return False
    return float((prior.normals[on_head] @ bolt.prior_from_bolt.z_axis).mean()) < _BACK_FACING


def _vouched(bolt: PriorBolt, remark: str) -> PriorBolt:
    """A measured head of which a person says that it is a bolt; its place may still be unsure."""
    confidence = 1.0 if bolt.is_sure else placement_probability(bolt.sigma_lateral_mm)
    return replace(bolt, confidence=confidence, remarks=(remark, *bolt.remarks))


def _turned(bolt: PriorBolt, config: EditConfig) -> PriorBolt:
    # about (0, 0, -h / 2) in frame `bolt`, the middle of the head
    turn = Transform.from_parts(
        "bolt", "bolt", np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, -bolt.head_height_mm)
    )
    return replace(
        bolt,
        side=Side.BOTTOM if bolt.side is Side.TOP else Side.TOP,
        prior_from_bolt=bolt.prior_from_bolt @ turn,
        sigma_axial_mm=max(bolt.sigma_axial_mm, config.unfitted_sigma_mm),
        is_sure=False,
        # the scan said one thing and the person another
        confidence=min(bolt.confidence, 0.5),
        remarks=(f"{FLIPPED}, no head was found that looks this way: its height is a guess",),
    )


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
        is_sure=False,
        confidence=placement_probability(config.unfitted_sigma_mm),
        remarks=(f"{ADDED}, no head could be fitted: the point given is used as it is",),
    )


def _require_room(prior: Prior, bolt: PriorBolt, where: str) -> None:
    for other in prior.bolts:
        gap = float(
            np.linalg.norm(
                other.prior_from_bolt.translation_mm - bolt.prior_from_bolt.translation_mm
            )
        )
        if gap < max(other.head_diameter_mm, bolt.head_diameter_mm) / 2:
            raise ConfigError(f"bolt {other.id} is already at {where} ({gap:.1f} mm beside)")


def _free_id(prior: Prior, side: Side) -> str:
    letter = "T" if side is Side.TOP else "B"
    taken = {bolt.id for bolt in prior.bolts}
    return next(f"{letter}{k}" for k in range(1, len(taken) + 2) if f"{letter}{k}" not in taken)


def _ordered(bolts: tuple[PriorBolt, ...]) -> tuple[PriorBolt, ...]:
    """Top bolts first, then by number; a removed number stays free until it is needed."""
    return tuple(sorted(bolts, key=lambda b: (b.side is Side.BOTTOM, len(b.id), b.id)))
