"""Cases for several views of one clamping: as they are, hidden, and with something wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import BoolArray, FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.locate_views import Shot
from boltpose.schema import Scan

HIDDEN_SHARE = 0.9
_OCCLUDER_AT = 0.6
"""What hides the motor is at this share of its distance: an arm, a hose, another part."""


class Kind(StrEnum):
    """What is done to the shots."""

    AS_IS = "as is"
    HIDDEN = "90 % hidden"
    SHIFT_HALF = "camera pose off by 0.5 mm"
    SHIFT_ONE = "camera pose off by 1 mm"
    SHIFT_TWO = "camera pose off by 2 mm"
    TURN = "camera pose off by 0.5 degrees"
    MOVED = "motor moved by 2 mm"


SHIFTS_MM = {Kind.SHIFT_HALF: 0.5, Kind.SHIFT_ONE: 1.0, Kind.SHIFT_TWO: 2.0}
TURN_RAD = float(np.radians(0.5))
MOVED_MM = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Which views are used, and what is done to them."""

    kind: Kind
    views: tuple[int, ...]

    @property
    def must_be_refused(self) -> bool:
        """Whether no pose is right for all views."""
        return self.kind not in (Kind.AS_IS, Kind.HIDDEN)


def list_cases(count: int) -> tuple[Case, ...]:
    """All cases of a clamping seen `count` times."""
    singles = [(view,) for view in range(count)]
    growing = [tuple(range(size)) for size in range(2, count + 1)]
    ends = list(dict.fromkeys([growing[0], growing[-1]]))
    cases = [Case(kind=Kind.AS_IS, views=views) for views in [*singles, *growing]]
    cases += [Case(kind=Kind.HIDDEN, views=views) for views in [*singles, *ends]]
    for kind in (Kind.SHIFT_HALF, Kind.SHIFT_ONE, Kind.TURN):
        cases.append(Case(kind=kind, views=ends[0]))
    for kind in (Kind.SHIFT_TWO, Kind.MOVED):
        cases += [Case(kind=kind, views=views) for views in ends]
    return tuple(cases)


def make_shots(
    case: Case, shots: Sequence[Shot], masks: Sequence[BoolArray], number: int
) -> list[Shot]:
    """Do to the shots what the case asks for; what is wrong is wrong in the last one alone.

    Args:
        case: The case.
        shots: All of the clamping, as they are.
        masks: Which points of each scan are truly on the motor.
        number: Of the motor; what is drawn by chance follows from it.

    Returns:
        The shots of the case.
    """
    chosen = [shots[view] for view in case.views]
    if case.kind is Kind.HIDDEN:
        return [
            replace(shots[view], scan=hide(shots[view].scan, masks[view], _rng(number, view)))
            for view in case.views
        ]
    if case.kind is Kind.AS_IS:
        return chosen
    last = case.views[-1]
    rng = _rng(number, 100 + last)
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    if case.kind is Kind.MOVED:
        points = np.array(chosen[-1].scan.points)
        points[masks[last]] += MOVED_MM * direction
        chosen[-1] = replace(chosen[-1], scan=_with_points(chosen[-1].scan, points))
        return chosen
    turn = Rotation.from_rotvec(TURN_RAD * direction if case.kind is Kind.TURN else np.zeros(3))
    error = Transform.from_parts(
        "camera", "camera", turn.as_matrix(), SHIFTS_MM.get(case.kind, 0.0) * direction
    )
    chosen[-1] = replace(chosen[-1], base_from_camera=chosen[-1].base_from_camera @ error)
    return chosen


def hide(scan: Scan, is_motor: BoolArray, rng: np.random.Generator) -> Scan:
    """Put something straight-edged before the camera that hides nine tenths of the motor.

    Args:
        scan: A view, frame `camera`.
        is_motor: Shape (N,), points truly on the motor.
        rng: Draws the direction of the edge.

    Returns:
        The view as the camera would see it then: what hides the motor is measured.
    """
    points = np.array(scan.points)
    angle = rng.uniform(0, 2 * np.pi)
    across = points[:, :2] / points[:, 2:] @ np.array([np.cos(angle), np.sin(angle)])
    edge = np.quantile(across[is_motor], HIDDEN_SHARE)
    behind = across < edge
    distance = _OCCLUDER_AT * float(np.median(points[is_motor, 2]))
    points[behind] *= distance / points[behind, 2:]
    return _with_points(scan, points)


def still_seen(before: Shot, after: Shot, is_motor: BoolArray) -> BoolArray:
    """Which points of a shot are on the motor after something was put before it, shape (N,)."""
    return is_motor & (before.scan.points == after.scan.points).all(axis=1)


def _with_points(scan: Scan, points: FloatArray) -> Scan:
    return Scan(points=points, pixels=scan.pixels, grid_shape=scan.grid_shape, source=scan.source)


def _rng(number: int, stream: int) -> np.random.Generator:
    return np.random.default_rng([number, stream])
