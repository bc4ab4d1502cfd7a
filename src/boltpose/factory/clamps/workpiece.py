"""What a clamp has to know about the motor it holds: where it is bare, how far it stands out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray, UInt8Array
from boltpose.errors import DegenerateGeometryError
from boltpose.factory.clamps.assembly import InfeasibleError
from boltpose.factory.model import MotorModel
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part

SAMPLE_AREA_MM2 = 5.0
"""About 2.2 mm between samples: over that distance no surface that a clamp grips leaves its chord
by more than the press of a contact face."""

BIN_DEG = 4
"""Width of the sectors in which the mantle is searched for bare stretches."""

BARE_MM = 1.2
"""What may stand out of a mantle that still counts as bare: crimps, bands, a name plate."""

TOUCHABLE = (Part.MAIN_HOUSING, Part.CONNECTOR, Part.SOLENOID)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Workpiece:
    """A motor as its clamp sees it, all in frame `motor`."""

    model: MotorModel
    points: FloatArray
    """Shape (N, 3), mm: vertices and evenly spread samples of all surfaces."""
    labels: UInt8Array
    """Shape (N,), `Part` numbers."""
    radius_mm: float
    """Of the yoke's mantle."""
    yoke_low_mm: float
    yoke_high_mm: float
    """Between these the mantle is cylindrical."""
    flange_front_mm: float
    """z of the mounting face: the front of the ears."""
    flange_back_mm: float
    """z of the back of the ears."""
    nose_centre_mm: FloatArray
    """Shape (2,): axis of nose and pinion."""

    @property
    def yoke_length_mm(self) -> float:
        """Length of the cylindrical mantle."""
        return self.yoke_high_mm - self.yoke_low_mm

    def reach_by_angle(self, z_low_mm: float, z_high_mm: float) -> FloatArray:
        """Largest distance from the axis in each sector of a slab, shape (360 / BIN_DEG,)."""
        z = self.points[:, 2]
        inside = self.points[(z >= z_low_mm) & (z <= z_high_mm)]
        reach = np.zeros(360 // BIN_DEG)
        np.maximum.at(reach, sector_of(inside), np.hypot(inside[:, 0], inside[:, 1]))
        return reach

    def bare_angles(
        self, z_low_mm: float, z_high_mm: float, half_width_deg: float, *, opposite: bool = False
    ) -> FloatArray:
        """Polar angles about which the mantle is bare for a while to both sides.

        Args:
            z_low_mm: Lower end of the slab.
            z_high_mm: Upper end of the slab.
            half_width_deg: How far to both sides.
            opposite: Also ask it of the opposite side.

        Returns:
            Shape (K,), degrees, middles of sectors; may be empty.
        """
        bare = self.reach_by_angle(z_low_mm, z_high_mm) <= self.radius_mm + BARE_MM
        good = eroded(bare, half_width_deg)
        if opposite:
            good &= np.roll(good, len(good) // 2)
        return np.asarray((np.flatnonzero(good) + 0.5) * BIN_DEG, dtype=np.float64)

    def pick_bare_angle(
        self,
        rng: np.random.Generator,
        slabs_mm: list[tuple[float, float]],
        half_width_deg: float,
        *,
        opposite: bool = False,
    ) -> float:
        """Draw a side on which the mantle is bare in all slabs.

        Raises:
            InfeasibleError: There is none.
        """
        choice = self.bare_angles(*slabs_mm[0], half_width_deg, opposite=opposite)
        for slab in slabs_mm[1:]:
            choice = np.intersect1d(
                choice, self.bare_angles(*slab, half_width_deg, opposite=opposite)
            )
        if len(choice) == 0:
            raise InfeasibleError("no bare side")
        return float(rng.choice(choice) + rng.uniform(-0.5, 0.5) * BIN_DEG)

    def posed(self, table_from_motor: Transform) -> PosedPoints:
        """The motor's surface in the frame of the table."""
        return PosedPoints(points=table_from_motor.apply(self.points), labels=self.labels)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PosedPoints:
    """Samples of the motor's surface, frame `table`."""

    points: FloatArray
    labels: UInt8Array

    def within(self, *limits: tuple[int, float, float]) -> BoolArray:
        """Which samples have coordinates within (axis, low, high)."""
        mask = np.ones(len(self.points), dtype=np.bool_)
        for axis, low, high in limits:
            mask &= (self.points[:, axis] >= low) & (self.points[:, axis] <= high)
        return mask

    def support(self, direction: tuple[float, float, float], mask: BoolArray) -> float:
        """How far the chosen samples reach along a direction.

        Raises:
            InfeasibleError: None is chosen, or what reaches furthest is nothing to clamp on.
        """
        if not mask.any():
            raise InfeasibleError("nothing to touch there")
        along = self.points[mask] @ np.asarray(direction, dtype=np.float64)
        if self.labels[mask][np.argmax(along)] not in TOUCHABLE:
            raise InfeasibleError("would touch a bolt, terminal or gear")
        return float(along.max())

    def support_any(self, direction: tuple[float, float, float], mask: BoolArray) -> float:
        """How far the chosen samples reach along a direction, whatever they belong to.

        Raises:
            InfeasibleError: None is chosen.
        """
        if not mask.any():
            raise InfeasibleError("nothing there")
        return float((self.points[mask] @ np.asarray(direction, dtype=np.float64)).max())

    def top_at(self, x_mm: float, y_mm: float, radius_mm: float) -> float:
        """Height of the motor under a vertical plunger."""
        near = np.hypot(self.points[:, 0] - x_mm, self.points[:, 1] - y_mm) <= radius_mm
        return self.support((0, 0, 1), near)

    def bottom_at(self, x_mm: float, y_mm: float, radius_mm: float) -> float:
        """Height of the motor's underside over a vertical post."""
        near = np.hypot(self.points[:, 0] - x_mm, self.points[:, 1] - y_mm) <= radius_mm
        return -self.support((0, 0, -1), near)

    def lowest(self) -> float:
        """Height of the lowest point."""
        return float(self.points[:, 2].min())


def inspect_motor(model: MotorModel) -> Workpiece:
    """Measure the motor.

    Raises:
        DegenerateGeometryError: It has no main housing or nothing in front of it.
    """
    clouds = [sample_surface(part.vertices, part.faces) for part in model.parts]
    points = np.concatenate(clouds)
    labels = np.repeat(
        np.array([int(part.part) for part in model.parts], dtype=np.uint8),
        [len(cloud) for cloud in clouds],
    )
    radius = model.spec.housing.radius_mm
    distance = np.hypot(points[:, 0], points[:, 1])
    mantle = (labels == Part.MAIN_HOUSING) & (np.abs(distance - radius) < 1.5)
    front = points[labels == Part.CONNECTOR]
    if not mantle.any() or len(front) == 0:
        raise DegenerateGeometryError("a clamp needs a motor with main housing and connector")
    yoke_low, yoke_high = np.quantile(points[mantle, 2], [0.01, 0.99])
    back_mm, front_mm = _ear_faces(model, front)
    gearbox = model.spec.gearbox
    centre = np.zeros(2)
    if gearbox is not None:
        angle = np.radians(gearbox.shaft_angle_deg)
        centre = gearbox.shaft_offset_mm * np.array([np.cos(angle), np.sin(angle)])
    return Workpiece(
        model=model,
        points=points,
        labels=labels,
        radius_mm=radius,
        yoke_low_mm=float(yoke_low),
        yoke_high_mm=float(yoke_high),
        flange_front_mm=front_mm,
        flange_back_mm=back_mm,
        nose_centre_mm=centre,
    )


def _ear_faces(model: MotorModel, front: FloatArray) -> tuple[float, float]:
    """Back and front of the ears; where there are none, of what reaches out furthest."""
    backs: list[float] = []
    fronts: list[float] = []
    for ear in model.spec.bracket.ears:
        angle = np.radians(ear.angle_deg)
        centre = ear.reach_mm * np.array([np.cos(angle), np.sin(angle)])
        from_hole = np.linalg.norm(front[:, :2] - centre, axis=1)
        # the outer half, where the body of the bracket is far
        outer = front[:, :2] @ (centre / ear.reach_mm) > ear.reach_mm
        ring = (from_hole > ear.hole_mm / 2 - 0.2) & (from_hole < ear.radius_mm - 1)
        near = front[ring & outer]
        if len(near):
            backs.append(float(near[:, 2].min()))
            fronts.append(float(near[:, 2].max()))
    if not fronts:
        distance = np.hypot(front[:, 0], front[:, 1])
        rim = front[distance > 0.9 * distance.max(), 2]
        return float(rim.min()), float(rim.max())
    return float(np.median(backs)), float(np.max(fronts))


def sector_of(points: FloatArray) -> IntArray:
    """Number of the sector about z in which each point lies, shape (N,)."""
    angle = np.degrees(np.arctan2(points[:, 1], points[:, 0])) % 360
    return np.minimum((angle / BIN_DEG).astype(np.int64), 360 // BIN_DEG - 1)


def eroded(ring: BoolArray, half_width_deg: float) -> BoolArray:
    """Which sectors of a ring are true together with all that are near."""
    steps = int(np.ceil(half_width_deg / BIN_DEG))
    good = ring.copy()
    for step in range(1, steps + 1):
        good &= np.roll(ring, step) & np.roll(ring, -step)
    return good


def sample_surface(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Vertices and evenly spread points of a mesh, without randomness.

    Returns:
        Shape (N, 3), mm.

    Source:
        Points within a triangle by the R2 sequence: M. Roberts, "The unreasonable effectiveness
        of quasirandom sequences", 2018.
    """
    corners = vertices[faces]
    edges = corners[:, 1:] - corners[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    # the running total gives long thin facets their share, which rounding each would not
    total = np.floor(np.cumsum(areas) / SAMPLE_AREA_MM2).astype(np.int64)
    counts = np.diff(total, prepend=0)
    owner = np.repeat(np.arange(len(faces)), counts)
    number = np.arange(len(owner))
    u = (0.5 + number * 0.7548776662466927) % 1
    v = (0.5 + number * 0.5698402909980532) % 1
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    inner = corners[owner, 0] + u[:, None] * edges[owner, 0] + v[:, None] * edges[owner, 1]
    return np.concatenate([vertices, inner])
