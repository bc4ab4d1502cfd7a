"""Compare the bolts found in a full scan with the true ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from boltpose.arrays import FloatArray
from boltpose.evaluation.reman18 import TrueBolt
from boltpose.geometry.transforms import angle_between_rad
from boltpose.schema import PriorBolt

GATE_MM = 5.0
"""Found and true `head_top` further apart than this are not the same bolt (issue 2)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltError:
    """How far a found bolt is from the true one. The true axis line is the yardstick."""

    lateral_mm: float
    """Distance of the found `head_top` from the true axis line: what the socket feels."""
    axial_mm: float
    """Found minus true `head_top` along the true axis, + is out of the head."""
    axis_rad: float
    """Angle between the found and the true outward axis; an upside-down bolt has pi."""

    @property
    def distance_mm(self) -> float:
        """Distance of the found from the true `head_top`: lateral and axial together."""
        return math.hypot(self.lateral_mm, self.axial_mm)


def measure_bolt_error(
    found_head_top: FloatArray,
    found_axis: FloatArray,
    true_head_top: FloatArray,
    true_axis: FloatArray,
) -> BoltError:
    """Split the error of one bolt into lateral, axial and axis error.

    Args:
        found_head_top: Shape (3,), mm, any frame.
        found_axis: Shape (3,), unit, the same frame.
        true_head_top: Shape (3,), mm, the same frame.
        true_axis: Shape (3,), unit, the same frame.

    Returns:
        The error.
    """
    offset = found_head_top - true_head_top
    axial = float(offset @ true_axis)
    return BoltError(
        lateral_mm=float(np.linalg.norm(offset - axial * true_axis)),
        axial_mm=axial,
        axis_rad=float(angle_between_rad(found_axis, true_axis)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltMatch:
    """A found bolt and the true one it stands for."""

    found_id: str
    true_id: int
    is_sure: bool
    is_side_right: bool
    error: BoltError
    sigma_lateral_mm: float
    """As the prior states it."""
    sigma_axial_mm: float
    head_diameter_error_mm: float
    """Found minus true."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseBolt:
    """A found bolt with no true one within the gate."""

    found_id: str
    is_sure: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltMatching:
    """The found and the true bolts of one motor, side by side."""

    matches: tuple[BoltMatch, ...]
    missed: tuple[int, ...]
    """Numbers of the true bolts that nothing was found for."""
    false: tuple[FalseBolt, ...]

    @property
    def true_id_of(self) -> dict[str, int]:
        """True number by found id, of the matched ones."""
        return {match.found_id: match.true_id for match in self.matches}


def match_bolts(
    found: Sequence[PriorBolt], truth: Sequence[TrueBolt], *, gate_mm: float = GATE_MM
) -> BoltMatching:
    """Pair found with true bolts: as many pairs within the gate as possible, then the closest.

    What is compared is `head_top` with the true `head_top`, both in frame `prior`; the distance
    holds the lateral and the axial error. The axis and the side take no part, so that a bolt at
    the right place with a wrong side counts as found with a wrong side.

    Args:
        found: Bolts of a prior.
        truth: Bolts of the same motor.
        gate_mm: The largest distance of a pair, inclusive.

    Returns:
        Matches in the order of the true numbers; what is left on either side.

    Raises:
        ValueError: `gate_mm` is not positive.

    Source:
        Kuhn, Naval Research Logistics 2, 1955 (assignment); the gate is issue 2's.
    """
    if not gate_mm > 0:
        raise ValueError(f"gate_mm must be > 0, got {gate_mm}")
    pairs = _assign(found, truth, gate_mm)
    matches = tuple(
        sorted((_match(found[i], truth[j]) for i, j in pairs), key=lambda match: match.true_id)
    )
    used_found = {i for i, _ in pairs}
    used_truth = {j for _, j in pairs}
    return BoltMatching(
        matches=matches,
        missed=tuple(sorted(b.id for j, b in enumerate(truth) if j not in used_truth)),
        false=tuple(
            FalseBolt(found_id=bolt.id, is_sure=bolt.is_sure)
            for i, bolt in enumerate(found)
            if i not in used_found
        ),
    )


def _assign(
    found: Sequence[PriorBolt], truth: Sequence[TrueBolt], gate_mm: float
) -> list[tuple[int, int]]:
    if not found or not truth:
        return []
    tops = np.array([bolt.prior_from_bolt.translation_mm for bolt in found])
    true_tops = np.array([bolt.head_top_mm for bolt in truth])
    distance = np.linalg.norm(tops[:, None] - true_tops[None], axis=2)
    # dearer than any sum of gated pairs: the number of gated pairs comes first
    forbidden = gate_mm * (min(distance.shape) + 1)
    rows, columns = linear_sum_assignment(np.where(distance <= gate_mm, distance, forbidden))
    return [
        (int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] <= gate_mm
    ]


def _match(bolt: PriorBolt, truth: TrueBolt) -> BoltMatch:
    return BoltMatch(
        found_id=bolt.id,
        true_id=truth.id,
        is_sure=bolt.is_sure,
        is_side_right=bolt.side is truth.side,
        error=measure_bolt_error(
            bolt.prior_from_bolt.translation_mm,
            bolt.prior_from_bolt.z_axis,
            truth.head_top_mm,
            truth.axis,
        ),
        sigma_lateral_mm=bolt.sigma_lateral_mm,
        sigma_axial_mm=bolt.sigma_axial_mm,
        head_diameter_error_mm=bolt.head_diameter_mm - truth.head_diameter_mm,
    )
