"""The motor bolted by its mounting flange to a plate: level, upright or sloping."""

from __future__ import annotations

import math

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.factory.clamps.assembly import (
    Assembly,
    ClampBody,
    InfeasibleError,
    frame_matrix,
    placed,
    table_pose,
    turn_about_y,
)
from boltpose.factory.clamps.fasteners import (
    bevelled_box,
    hex_screw,
    nut_on_stud,
    socket_screw,
)
from boltpose.factory.clamps.wedge import centred, wedge_bodies
from boltpose.factory.clamps.workpiece import PosedPoints, Workpiece
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, cylinder, manifold_of, prism, union
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part

_SEAT_MM = 0.1
"""How far ears are pressed into the plate and screw heads into ears, before nests are cut."""


def _ear_screws(
    rng: np.random.Generator, work: Workpiece, pose: Transform, posed: PosedPoints, plate_mm: float
) -> list[ClampBody]:
    """Screws through the ears of a motor that stands nose down on the plate z = 0.

    Raises:
        InfeasibleError: Fewer than two ears have a hole and room for a head.
    """
    screws: list[ClampBody] = []
    for index, ear in enumerate(work.model.spec.bracket.ears):
        angle = math.radians(ear.angle_deg)
        spot = pose.apply(
            (ear.reach_mm * math.cos(angle), ear.reach_mm * math.sin(angle), work.flange_front_mm)
        )
        x, y = float(spot[0]), float(spot[1])
        away = np.hypot(posed.points[:, 0] - x, posed.points[:, 1] - y)
        body = _ear_screw(rng, away, posed.points[:, 2], ear.hole_mm / 2, plate_mm)
        if body is not None:
            screws.append(
                ClampBody(
                    name=f"ear_screw_{index}",
                    body=body.translate((x, y, 0)),
                    material=Material.ZINC if rng.random() < 0.6 else Material.BARE_STEEL,
                    give_mm=0.3,
                )
            )
    if len(screws) < 2:
        raise InfeasibleError("too few ears to bolt down")
    return screws


def _ear_screw(
    rng: np.random.Generator, away: FloatArray, z: FloatArray, hole_mm: float, plate_mm: float
) -> Manifold | None:
    """The screw through one ear, about the z axis.

    Args:
        rng: Source of its size and kind.
        away: Shape (N,), distance of the motor's points from the screw's axis.
        z: Shape (N,), their heights; the ear lies on z = 0.
        hole_mm: Radius of the ear's hole.
        plate_mm: Thickness of the plate.

    Returns:
        The screw; None where none has room.
    """
    rim = (away > hole_mm - 0.2) & (away < hole_mm + 0.8)
    sizes = [size for size in (5, 6, 8, 10, 12) if size < 2 * hole_mm - 0.8]
    if not sizes or not rim.any():
        return None
    seat = float(z[rim].max())
    for size in (sizes[-1], int(rng.choice(sizes))):
        nut = nut_on_stud(size, 1.6 * size).mirror((0, 0, 1)).translate((0, 0, -plate_mm))
        for kind in rng.permutation(3):
            head = (hex_screw(size), hex_screw(size, washer=False), socket_screw(size))[kind]
            radius = float(np.asarray(head.bounding_box())[3]) + 0.3
            crowded = (away < radius) & (z > seat + 0.4) & (z < seat + 2.2 * size)
            if radius > hole_mm + 0.6 and seat < 40 and not crowded.any():
                shank = cylinder(size / 2, -plate_mm - 1, seat + 0.5)
                turned = head.rotate((0, 0, float(rng.uniform(0, 360))))
                return union([turned.translate((0, 0, seat - _SEAT_MM)), shank, nut])
    # no room for a head behind the ear: the screw comes from below into its thread
    size = sizes[-1]
    deep = 0.6 * min(seat, 20.0)
    if ((away < hole_mm - 0.3) & (z > 0) & (z < deep + 1)).any():
        return None
    head = hex_screw(size).mirror((0, 0, 1)).translate((0, 0, -plate_mm))
    thread = cylinder(hole_mm + 0.05, -0.5, deep)
    return union([head, cylinder(size / 2, -plate_mm - 1, 0), thread])


def _opening(
    rng: np.random.Generator, work: Workpiece, pose: Transform, deep_mm: float
) -> Manifold:
    """What has to be cut out of the plate z = 0 for all that stands in front of the flange."""
    turn = np.ascontiguousarray(pose.matrix[:3])
    below = [
        manifold_of(part).transform(turn).trim_by_plane((0, 0, -1), 3 * _SEAT_MM)
        for part in work.model.parts
    ]
    outline = union([body for body in below if not body.is_empty()]).project()
    clear = float(rng.uniform(2, 5))
    cut = outline.offset(clear).extrude(deep_mm + 2).translate((0, 0, -deep_mm - 1))
    centre = pose.apply((*work.nose_centre_mm, 0.0))
    posed = pose.apply(work.points)
    away = np.hypot(posed[:, 0] - centre[0], posed[:, 1] - centre[1])
    nose = (posed[:, 2] < -1) & (away < 1.1 * work.radius_mm)
    if nose.any() and work.labels[nose].max() > Part.BACKGROUND:
        hole = cylinder(float(away[nose].max()) + clear, -deep_mm - 1, 1)
        cut += hole.translate((float(centre[0]), float(centre[1]), 0))
    return cut


def build_flange_plate(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A plate with an opening for the nose, screws through the motor's ears."""
    thick = float(rng.uniform(10, 20))
    turn = float(rng.uniform(0, 360))
    # nose down, the mounting face a touch below z = 0
    pose = table_pose((0, 0, -1), (1, 0, 0), turn, (0, 0, work.flange_front_mm - _SEAT_MM))
    posed = work.posed(pose)
    front = float(-posed.lowest())
    screws = _ear_screws(rng, work, pose, posed, thick)
    opening = _opening(rng, work, pose, thick)
    around = np.asarray(opening.bounding_box())
    ears = np.array([np.asarray(screw.body.bounding_box()) for screw in screws])
    low = np.minimum(around[:2], ears[:, :2].min(axis=0)) - rng.uniform(10, 40, size=2)
    high = np.maximum(around[3:5], ears[:, 3:5].max(axis=0)) + rng.uniform(10, 40, size=2)
    kind = int(rng.choice([0, 1, 1, 2]))
    material = (Material.BARE_STEEL, Material.CAST_IRON, Material.CAST_ALUMINIUM)[rng.integers(3)]
    if kind == 0:
        return _level(rng, pose, screws, opening, (low, high), thick, front, material)
    if kind == 1:
        # x of the plate will look down: it reaches from the axis to the ground
        needed = float(posed.points[:, 0].max()) + float(rng.uniform(5, 20))
        high[0] = max(float(high[0]), needed)
        return _upright(rng, pose, screws, opening, (low, high), thick, material)
    return _sloping(rng, work, pose, screws, opening, (low, high), thick, material)


def _plate(
    opening: Manifold, limits: tuple[FloatArray, FloatArray], thick_mm: float, material: Material
) -> ClampBody:
    """The plate below z = 0."""
    low, high = limits
    size = (float(high[0] - low[0]), float(high[1] - low[1]), thick_mm)
    middle = (float(high[0] + low[0]) / 2, float(high[1] + low[1]) / 2, -thick_mm / 2)
    body = bevelled_box(size, 0.8, middle) - opening
    pieces = body.decompose()
    if len(pieces) != 1:
        raise InfeasibleError("the opening would cut the plate in two")
    return ClampBody(name="flange_plate", body=body, material=material, give_mm=0.3)


def _level(
    rng: np.random.Generator,
    pose: Transform,
    screws: list[ClampBody],
    opening: Manifold,
    limits: tuple[FloatArray, FloatArray],
    thick_mm: float,
    front_mm: float,
    material: Material,
) -> Assembly:
    """The plate on four posts, the motor upside down on it."""
    plate = _plate(opening, limits, thick_mm, material)
    low, high = limits
    lift = max(front_mm, thick_mm + 22.0) + float(rng.uniform(5, 30))
    square = rng.random() < 0.5
    half = float(rng.uniform(9, 13))
    tall = lift - thick_mm
    feet: list[Manifold] = []
    heads: list[Manifold] = []
    for x in (float(low[0]) + half + 2, float(high[0]) - half - 2):
        for y in (float(low[1]) + half + 2, float(high[1]) - half - 2):
            post = (
                bevelled_box((2 * half, 2 * half, tall), 0.8, (0, 0, tall / 2))
                if square
                else cylinder(half, 0, tall)
            )
            feet.append(post.translate((x, y, 0)))
            heads.append(socket_screw(8).translate((x, y, lift)))
    up = frame_matrix((1, 0, 0), (0, 1, 0), (0, 0, lift))
    bodies = [
        *placed((plate, *screws), up),
        ClampBody(name="posts", body=union(feet), material=Material.BARE_STEEL, give_mm=0.05),
        ClampBody(name="post_screws", body=union(heads), material=Material.ZINC, give_mm=0.05),
    ]
    return centred(
        Assembly(bodies=tuple(bodies), table_from_motor=Transform("table", "table", up) @ pose)
    )


def _upright(
    rng: np.random.Generator,
    pose: Transform,
    screws: list[ClampBody],
    opening: Manifold,
    limits: tuple[FloatArray, FloatArray],
    thick_mm: float,
    material: Material,
) -> Assembly:
    """An angle plate: the motor sticks out level, ribs and foot are on the nose's side."""
    plate = _plate(opening, limits, thick_mm, material)
    low, high = limits
    turn = turn_about_y(90)
    turn[2, 3] = float(high[0])
    tall = float(high[0] - low[0])
    wide = float(high[1] - low[1])
    middle = float(high[1] + low[1]) / 2
    foot = float(rng.uniform(0.5, 0.85)) * tall
    foot_thick = float(rng.uniform(12, 18))
    rib_thick = float(rng.uniform(8, 14))
    body = bevelled_box((foot, wide, foot_thick), 0.8).translate(
        (-thick_mm - foot / 2 + 1, middle, foot_thick / 2)
    )
    pieces = [
        *placed((plate, *screws), turn),
        ClampBody(name="angle_foot", body=body, material=material, give_mm=0.05),
    ]
    rib_tall = float(rng.uniform(0.6, 0.95)) * tall
    front, back = -thick_mm + 0.5, -thick_mm - foot * 0.92
    outline = [
        (front, 0.0),
        (front, rib_tall),
        (-thick_mm - 8, rib_tall),
        (back, foot_thick + 8),
        (back, 0.0),
    ]
    rib = prism(outline, -rib_thick / 2, rib_thick / 2).rotate((90, 0, 0))
    for index, side in enumerate((-1, 1)):
        y = middle + side * (wide / 2 - rib_thick / 2 - 0.5)
        pieces.append(
            ClampBody(
                name=f"angle_rib_{index}",
                body=rib.translate((0, y, 0)),
                material=material,
                give_mm=0.05,
            )
        )
    size = int(rng.choice([10, 12]))
    heads = [
        hex_screw(size).translate(
            (-thick_mm - share * foot, middle + side * wide * 0.25, foot_thick)
        )
        for share in (0.45, 0.8)
        for side in (-1, 1)
    ]
    pieces.append(
        ClampBody(name="angle_screws", body=union(heads), material=Material.ZINC, give_mm=0.05)
    )
    return centred(
        Assembly(bodies=tuple(pieces), table_from_motor=Transform("table", "table", turn) @ pose)
    )


def _sloping(
    rng: np.random.Generator,
    work: Workpiece,
    pose: Transform,
    screws: list[ClampBody],
    opening: Manifold,
    limits: tuple[FloatArray, FloatArray],
    thick_mm: float,
    material: Material,
) -> Assembly:
    """The plate on cheeks at 20 to 60 degrees; nothing between them, for the nose."""
    low, high = limits
    plate = _plate(opening, limits, thick_mm, material)
    tilt = turn_about_y(float(rng.uniform(20, 60)))
    lowest = min(
        work.posed(Transform("table", "table", tilt) @ pose).lowest(),
        float((tilt[:3, :3] @ (high[0], 0, -thick_mm))[2]),
    )
    tilt[2, 3] = -lowest + float(rng.uniform(6, 25))
    middle = float(high[1] + low[1]) / 2
    under = tilt @ frame_matrix((1, 0, 0), (0, 1, 0), (0, middle, -thick_mm))
    wedge = wedge_bodies(
        rng, under, (float(low[0]), float(high[0])), float(high[1] - low[1]), closed=False
    )
    return centred(
        Assembly(
            bodies=(*placed((plate, *screws), tilt), *wedge),
            table_from_motor=Transform("table", "table", tilt) @ pose,
        )
    )
