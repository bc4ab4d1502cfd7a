"""The records that clamp designs are put together from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from boltpose.arrays import FloatArray
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold
from boltpose.geometry.transforms import Transform

PRESS_MM = 0.25
"""How deep a contact face is pushed into the motor before its nest is cut: surfaces then touch."""


class InfeasibleError(Exception):
    """This design with these random numbers does not fit this motor; try others."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClampBody:
    """One solid piece of a clamp, in the frame of the assembly."""

    name: str
    body: Manifold
    material: Material
    give_mm: float = 0.8
    """How far, on average over the touching area, the motor may dip into it before the nest is
    cut; more means that the piece is in the motor's way."""

    def placed(self, matrix: FloatArray) -> ClampBody:
        """The same piece moved by a rigid motion of shape (3, 4) or (4, 4)."""
        return replace(self, body=self.body.transform(np.ascontiguousarray(matrix[:3])))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Assembly:
    """A clamp and the pose of the motor in it; z is up, z = 0 is the top of the base plate."""

    bodies: tuple[ClampBody, ...]
    table_from_motor: Transform

    def moved(self, table_from_assembly: Transform) -> Assembly:
        """Clamp and motor together, moved."""
        return Assembly(
            bodies=placed(self.bodies, table_from_assembly.matrix),
            table_from_motor=Transform(
                "table", "motor", table_from_assembly.matrix @ self.table_from_motor.matrix
            ),
        )


def placed(bodies: Iterable[ClampBody], matrix: FloatArray) -> tuple[ClampBody, ...]:
    """Several pieces moved by one rigid motion."""
    return tuple(body.placed(matrix) for body in bodies)


def shifted(bodies: Iterable[ClampBody], offset_mm: Sequence[float]) -> tuple[ClampBody, ...]:
    """Several pieces moved by a translation."""
    return placed(bodies, frame_matrix((1, 0, 0), (0, 1, 0), offset_mm))


def frame_matrix(
    x_axis: Sequence[float], y_axis: Sequence[float], origin_mm: Sequence[float]
) -> FloatArray:
    """The (4, 4) motion that takes x, y and the origin there; the axes must be orthonormal."""
    matrix = np.eye(4)
    matrix[:3, 0] = x_axis
    matrix[:3, 1] = y_axis
    matrix[:3, 2] = np.cross(np.asarray(x_axis, float), np.asarray(y_axis, float))
    matrix[:3, 3] = origin_mm
    return matrix


def turn_about_z(angle_deg: float, origin_mm: Sequence[float] = (0, 0, 0)) -> FloatArray:
    """The (4, 4) turn about z, followed by a translation."""
    angle = np.radians(angle_deg)
    cosine, sine = np.cos(angle), np.sin(angle)
    return frame_matrix((cosine, sine, 0), (-sine, cosine, 0), origin_mm)


def turn_about_y(angle_deg: float, origin_mm: Sequence[float] = (0, 0, 0)) -> FloatArray:
    """The (4, 4) turn about y, followed by a translation."""
    angle = np.radians(angle_deg)
    cosine, sine = np.cos(angle), np.sin(angle)
    return frame_matrix((cosine, 0, -sine), (0, 1, 0), origin_mm)


def table_pose(
    axis: npt.ArrayLike, side: npt.ArrayLike, side_angle_deg: float, origin_mm: npt.ArrayLike
) -> Transform:
    """The pose that puts the motor's axis and one of its sides where they shall be.

    Args:
        axis: Unit; where z of frame `motor` shall point, frame `table`.
        side: Unit, perpendicular to `axis`; where the motor's side shall point.
        side_angle_deg: Polar angle of that side about z of frame `motor`.
        origin_mm: Where the motor's origin shall be, frame `table`.

    Returns:
        `table_from_motor`.
    """
    along, across = np.asarray(axis, dtype=np.float64), np.asarray(side, dtype=np.float64)
    target = np.stack([across, np.cross(along, across), along], axis=1)
    angle = np.radians(side_angle_deg)
    source = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    return Transform.from_parts("table", "motor", target @ source.T, origin_mm)
