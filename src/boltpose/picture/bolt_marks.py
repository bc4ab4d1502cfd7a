"""What is drawn at a bolt, and where its name goes; no drawing, so that no plotting is imported."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.picture.view import View
from boltpose.schema import BoltState, LocatedBolt, LocateResult, Visibility

ARROW_MM = 26.0
"""Length of the arrow along a bolt's axis, out of its head."""
_ROUND_MM = (1, 2, 5, 10, 20, 50, 100, 200, 500)


class Ink(Enum):
    """How a bolt is drawn; a person who sees no colours still has the dashes and hollow heads."""

    SEEN = ("#c8102e", "-", True, "seen")
    PARTIAL = ("#c8102e", "-", False, "partly seen")
    HIDDEN = ("#d9730d", (0, (3, 1.6)), False, "hidden: pose known from the prior")
    FORBIDDEN = ("#111111", "-", False, "contradicted: no tool there")
    """Crossed out and without an arrow: there is nothing to follow."""

    def __init__(
        self, color: str, dashes: str | tuple[int, tuple[float, float]], is_solid: bool, label: str
    ) -> None:
        self.color = color
        self.dashes = dashes
        self.is_solid = is_solid
        self.label = label


INK_OF = {
    Visibility.VISIBLE: Ink.SEEN,
    Visibility.PARTIAL: Ink.PARTIAL,
    Visibility.HIDDEN: Ink.HIDDEN,
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoltMark:
    """One bolt to draw."""

    name: str
    scene_from_bolt: Transform
    """Frame of the picture's points from frame `bolt`."""
    head_diameter_mm: float
    ink: Ink
    is_sure: bool


def camera_marks(result: LocateResult) -> list[BoltMark]:
    """Every bolt of a result as it is drawn over its scan, frame `camera`.

    Args:
        result: Of `locate`; if its frame is `base` its hand-eye is in it.

    Returns:
        One mark per bolt, in the result's order; none when refused.
    """
    camera_from_frame = camera_from_result(result)
    return [mark_of(bolt, camera_from_frame) for bolt in result.bolts]


def camera_from_result(result: LocateResult) -> Transform:
    """From the frame of a result's bolts to `camera`."""
    if result.frame == "camera" or result.base_from_camera is None:
        return Transform.identity("camera", "camera")
    return result.base_from_camera.inverse()


def mark_of(bolt: LocatedBolt, camera_from_frame: Transform) -> BoltMark:
    """One located bolt as it is drawn; one that the camera contradicts is crossed out."""
    is_forbidden = bolt.state is BoltState.CONTRADICTED
    return BoltMark(
        name=bolt.id,
        scene_from_bolt=camera_from_frame @ bolt.frame_from_bolt,
        head_diameter_mm=bolt.head_diameter_mm,
        ink=Ink.FORBIDDEN if is_forbidden else INK_OF[bolt.visibility],
        is_sure=bolt.is_sure,
    )


def arrow_tips(marks: Iterable[BoltMark], reach_mm: float = 30.0) -> list[FloatArray]:
    """Where arrows and names end: points that a picture must not cut off, shape (1, 3) each."""
    return [mark.scene_from_bolt.apply(np.array([[0.0, 0.0, reach_mm]])) for mark in marks]


def head_ring(view: View, mark: BoltMark, corners: int = 32) -> FloatArray:
    """The outline of a head's top in a picture; shape (corners + 1, 2), pixels, closed."""
    turn = np.linspace(0, 2 * np.pi, corners + 1)
    ring_bolt = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    return view.project(mark.scene_from_bolt.apply(mark.head_diameter_mm / 2 * ring_bolt))[:, :2]


def arrow_ends(view: View, mark: BoltMark) -> FloatArray:
    """Tail and tip of a bolt's arrow; shape (2, 2), pixels."""
    ends_bolt = np.array([[0, 0, 0], [0, 0, ARROW_MM]])
    return view.project(mark.scene_from_bolt.apply(ends_bolt))[:, :2]


def scale_bar_mm(view: View) -> int:
    """A round length of about a fifth of the picture's width, at the subject's distance."""
    wanted_mm = 0.22 * view.width / view.pixels_per_mm
    return max((size for size in _ROUND_MM if size <= wanted_mm), default=1)


def place_names(shafts: FloatArray, view: View) -> list[FloatArray]:
    """Put each name near its arrow's tip where it covers no other name and no arrow.

    Args:
        shafts: Shape (N, 2, 2), pixels: tail and tip of every arrow.
        view: The picture.

    Returns:
        One centre, shape (2,), per arrow.
    """
    along = shafts[:, 0, None] + np.linspace(0, 1, 9)[None, :, None] * np.diff(shafts, axis=1)
    places: list[FloatArray] = []
    for number, (tail, tip) in enumerate(shafts):
        direction = tip - tail
        length = float(np.linalg.norm(direction))
        # an arrow seen end on has no direction: the name goes up and to the right of it
        heading = np.arctan2(direction[1], direction[0]) if length > 8 else -np.pi / 4
        turns = heading + np.radians([0, 35, -35, 70, -70, 105, -105, 140, -140, 180])
        options = np.concatenate(
            [tip + reach * np.stack([np.cos(turns), np.sin(turns)], axis=1) for reach in (18, 30)]
        )
        cost = np.tile(np.linspace(0, 3, len(turns)), 2) + np.repeat([0.0, 2.0], len(turns))
        others = np.delete(along, number, axis=0).reshape(-1, 2)
        cost += 4.0 * _crowding(options, others, 15)
        cost += 2.0 * _crowding(options, along[number], 12)
        cost += 9.0 * _crowding(options, np.array(places).reshape(-1, 2), 32)
        inside = np.clip(options, (20, 14), (view.width - 20, view.height - 14))
        cost += 0.5 * np.abs(options - inside).sum(axis=1)
        places.append(inside[int(np.argmin(cost))])
    return places


def _crowding(options: FloatArray, others: FloatArray, reach: float) -> FloatArray:
    """How deep each option, shape (M, 2), lies in the surroundings of the others; shape (M,)."""
    if len(others) == 0:
        return np.zeros(len(options))
    difference = options[:, None] - others[None]
    # a name is about one and a half times as wide as high
    distance = np.hypot(difference[..., 0], 1.5 * difference[..., 1])
    return np.clip(1 - distance / reach, 0, None).max(axis=1) * 3
