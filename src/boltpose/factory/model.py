"""What the factory makes: named watertight solids, and the true pose of every bolt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from boltpose.arrays import FloatArray, IntArray, as_points, freeze
from boltpose.errors import ShapeError
from boltpose.factory.spec import BoltSpec, MotorSpec
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part, Side


class Material(StrEnum):
    """What a surface is made of; the sensor models look up how it reflects."""

    PAINTED_STEEL = "painted_steel"
    BARE_STEEL = "bare_steel"
    ZINC = "zinc"
    CAST_ALUMINIUM = "cast_aluminium"
    CAST_IRON = "cast_iron"
    BLACK_PLASTIC = "black_plastic"
    GREY_PLASTIC = "grey_plastic"
    COPPER = "copper"
    RUBBER = "rubber"
    RUST = "rust"
    GREASE = "grease"
    WOOD = "wood"
    STRAP = "strap"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SolidPart:
    """One watertight solid, in place."""

    name: str
    """Unique in its model; starts with the class or, for a bolt, is `bolt_` and its id."""
    part: Part
    material: Material
    vertices: FloatArray
    """Shape (V, 3), float64, mm, frame of the model (`motor` for a motor)."""
    faces: IntArray
    """Shape (F, 3), int64, counter-clockwise seen from outside."""
    bolt_id: str | None = None
    """Which bolt's head this is, with its shank unless that is a rod; None for all else."""

    def __post_init__(self) -> None:
        vertices = as_points(self.vertices, "vertices", at_least=4)
        faces = np.asarray(self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
            raise ShapeError(
                f"faces must be integers of shape (F, 3), got {faces.dtype} {faces.shape}"
            )
        object.__setattr__(self, "vertices", freeze(vertices))
        object.__setattr__(self, "faces", freeze(faces.astype(np.int64)))

    def moved(self, target_from_source: Transform) -> SolidPart:
        """The same solid in another frame."""
        return replace(self, vertices=target_from_source.apply(self.vertices))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrueBolt:
    """One bolt as it was built. Frame `bolt`: origin `head_top` on the axis, +z out of the head."""

    id: str
    """`T1`, `T2` ... for heads that look along +z, `B1` ... along -z."""
    spec: BoltSpec
    side: Side
    motor_from_bolt: Transform
    across_mm: float
    """Spanner size of a hexagon, diameter of a round head."""
    head_diameter_mm: float
    """Of the circle around the whole head, flange included."""
    head_height_mm: float
    """From the seat to the top face, flange included."""

    @property
    def head_top(self) -> FloatArray:
        """Shape (3,), mm, frame `motor`: centre of the top face."""
        return self.motor_from_bolt.translation_mm

    @property
    def axis(self) -> FloatArray:
        """Shape (3,), unit, frame `motor`, out of the head."""
        return self.motor_from_bolt.z_axis

    @property
    def head_centre(self) -> FloatArray:
        """Shape (3,), mm, frame `motor`: on the axis, half way up the head."""
        return self.head_top - 0.5 * self.head_height_mm * self.axis


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotorModel:
    """A motor as solids, in frame `motor`.

    Its origin is on the housing's axis half way along the whole motor without terminals, z points
    from main housing to connector, y towards the solenoid.
    """

    spec: MotorSpec
    parts: tuple[SolidPart, ...]
    bolts: tuple[TrueBolt, ...]
    """Those present; a missing bolt leaves an empty hole and is not listed."""

    def parts_of(self, part: Part) -> tuple[SolidPart, ...]:
        """All solids of one class."""
        return tuple(solid for solid in self.parts if solid.part == part)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SceneModel:
    """A clamped motor and all that stands around it.

    Frame `table`: z up, origin on the base plate under the clamp.
    """

    clamp_name: str
    solids: tuple[SolidPart, ...]
    """Clamp, base plate, table and clutter (all of class background), then the motor's parts."""
    table_from_motor: Transform


def bounds_mm(solids: Sequence[SolidPart]) -> FloatArray:
    """Shape (2, 3): the smallest and largest coordinate of all vertices."""
    return np.array(
        [
            np.min([solid.vertices.min(axis=0) for solid in solids], axis=0),
            np.max([solid.vertices.max(axis=0) for solid in solids], axis=0),
        ]
    )
