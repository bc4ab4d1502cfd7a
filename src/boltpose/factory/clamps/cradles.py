"""Cradles: saddles cut to the motor with straps over it, level or tilted."""

from __future__ import annotations

import math

import numpy as np

from boltpose.factory.clamps.assembly import (
    PRESS_MM,
    Assembly,
    ClampBody,
    InfeasibleError,
    frame_matrix,
    turn_about_y,
)
from boltpose.factory.clamps.fasteners import bevelled_box, hex_screw, nut_on_stud, socket_screw
from boltpose.factory.clamps.v_blocks import along_x, lay_down, stations
from boltpose.factory.clamps.wedge import centred, wedge_bodies
from boltpose.factory.clamps.workpiece import PosedPoints, Workpiece
from boltpose.factory.model import Material
from boltpose.factory.solids import CrossSection, Manifold, box, cylinder, prism, union
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part

_X_FROM_Z = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0]])
"""Turns z of an extrusion to x, its x to y and its y to z."""


def _saddle(
    x_mm: tuple[float, float], axis_mm: float, radius_mm: float, wrap_deg: float, wide_mm: float
) -> Manifold:
    """A plate across x with a round nest; it wraps that far round from straight down."""
    inner = radius_mm - PRESS_MM
    angles = np.radians(np.linspace(-90 - wrap_deg, -90 + wrap_deg, 41))
    arc = [(inner * math.cos(a), axis_mm + inner * math.sin(a)) for a in angles]
    top = arc[0][1]
    outline = [(-wide_mm, 0.0), (wide_mm, 0.0), (wide_mm, top), *reversed(arc), (-wide_mm, top)]
    body = prism(outline, x_mm[0], x_mm[1])
    return body.transform(_X_FROM_Z)


def _strap(
    rng: np.random.Generator,
    work: Workpiece,
    pose: Transform,
    name: str,
    x_mm: float,
    anchor_mm: tuple[float, float],
    widest_mm: float,
) -> tuple[ClampBody, ...]:
    """A band across a lying motor from anchor to anchor, with a ratchet or bolted ends.

    Args:
        rng: Source of its kind and sizes.
        work: The motor.
        pose: Its pose.
        name: Prefix of the pieces' names.
        x_mm: Where the band crosses.
        anchor_mm: Distance from y = 0 and height of the anchors.
        widest_mm: How wide the band may be.
    """
    posed = work.posed(pose)
    metal = rng.random() < 0.35
    wide = min(float(rng.uniform(14, 24) if metal else rng.uniform(20, 38)), widest_mm)
    thick = float(rng.uniform(1.6, 3))
    half, low = anchor_mm
    mask = posed.within((0, x_mm - wide / 2 - 1.5, x_mm + wide / 2 + 1.5), (2, low, 1e9))
    if not mask.any():
        raise InfeasibleError("nothing under the strap")
    covered = set(posed.labels[mask].tolist())
    if covered & {Part.ELECTRICAL_CONNECTOR, Part.GEAR}:
        raise InfeasibleError("a strap would lie over terminals")
    outline = np.concatenate([posed.points[mask][:, 1:], [(-half, low), (half, low), (0, low)]])
    core = CrossSection.hull_points(outline)
    band = core.offset(thick - PRESS_MM) - core.offset(-PRESS_MM)
    ring = band.extrude(wide).translate((0, 0, x_mm - wide / 2)).transform(_X_FROM_Z)
    ring = ring.trim_by_plane((0, 0, 1), low)
    material = Material.BARE_STEEL if metal else Material.STRAP
    pieces = [ClampBody(name=name, body=ring, material=material, give_mm=0.9)]
    reach = max(float(np.abs(outline[:, 0]).max()), half)
    if reach > half + 3:
        raise InfeasibleError("the motor overhangs the strap's anchors")
    foot = float(rng.uniform(14, 20))
    for index, sign in enumerate((-1, 1)):
        y = sign * (half + foot / 2)
        plate = box((wide + 6, foot, 4), (x_mm, y, low + 2))
        ear = box((wide + 6, 3, 14), (x_mm, sign * (half + thick + 1), low + 7))
        size = 6 if wide < 24 else 8
        screw = hex_screw(size) if rng.random() < 0.6 else nut_on_stud(size, 18)
        pieces.append(
            ClampBody(
                name=f"{name}_anchor_{index}",
                body=union([plate, ear, screw.translate((x_mm, y + sign * 3, low + 4))]),
                material=Material.ZINC,
                give_mm=0.05,
            )
        )
    if not metal and rng.random() < 0.7:
        pieces += _ratchet(rng, core, f"{name}_ratchet", x_mm, wide, low)
    return tuple(pieces)


def _pick_nest(
    rng: np.random.Generator, work: Workpiece, slabs: list[tuple[float, float]]
) -> tuple[float, float]:
    """How far the nests wrap round from straight down, and which side of the motor looks down.

    Raises:
        InfeasibleError: Not even shallow nests find a bare side.
    """
    wrap = float(rng.uniform(45, 85))
    while wrap > 30:
        try:
            return wrap, work.pick_bare_angle(rng, slabs, wrap + 3)
        except InfeasibleError:
            wrap -= 10
    raise InfeasibleError("no bare side for a nest")


def _strap_places(
    rng: np.random.Generator, posed: PosedPoints, x_mm: tuple[float, float]
) -> tuple[list[float], float]:
    """Where along a lying motor one or two straps can cross, and how wide they may be.

    They must not press on terminals.

    Raises:
        InfeasibleError: Nowhere.
    """
    low, high = x_mm
    delicate = np.isin(posed.labels, (Part.ELECTRICAL_CONNECTOR, Part.GEAR))
    taken = np.sort(posed.points[delicate, 0])
    places = np.arange(low + 10, high - 8, 2.0)
    for wide in (38.0, 27.0, 18.0):
        room = wide / 2 + 2
        free = [
            float(x)
            for x in places
            if np.searchsorted(taken, x - room) == np.searchsorted(taken, x + room)
        ]
        if free:
            first = float(rng.choice(free))
            others = [x for x in free if abs(x - first) > wide + 8]
            if others and rng.random() < 0.6:
                return [first, float(rng.choice(others))], wide
            return [first], wide
    raise InfeasibleError("a strap would lie over terminals")


def _ratchet(
    rng: np.random.Generator,
    core: CrossSection,
    name: str,
    x_mm: float,
    wide_mm: float,
    low_mm: float,
) -> tuple[ClampBody, ...]:
    """A ratchet on the longest straight stretch of a strap; none if it has no such stretch."""
    corners = np.asarray(max(core.to_polygons(), key=len))
    following = np.roll(corners, -1, axis=0)
    edges = following - corners
    lengths = np.linalg.norm(edges, axis=1)
    lengths[np.minimum(corners[:, 1], following[:, 1]) < low_mm + 0.1] *= 0.999
    outward_z = -edges[:, 0]  # contours run counter-clockwise
    lengths[(outward_z < 0) & (np.abs(edges[:, 1]) < 1e-6)] = 0  # not the bottom
    best = int(np.argmax(lengths))
    if lengths[best] < 30:
        return ()
    tangent = edges[best] / lengths[best]
    outward = np.array([tangent[1], -tangent[0]])
    origin = corners[best] + tangent * lengths[best] * 0.5 + outward * 2.5
    size = min(float(rng.uniform(26, 44)), lengths[best] - 4)
    frame = [box((2.5, size, 16), (sign * (wide_mm / 2 + 2), 0, 7)) for sign in (-1, 1)]
    axles = [
        cylinder(radius, -wide_mm / 2 - 5, wide_mm / 2 + 5).rotate((0, 90, 0)).translate((0, y, z))
        for radius, y, z in ((6, -size * 0.2, 7.5), (3, size * 0.36, 5))
    ]
    wheels = [
        cylinder(10, -1.5, 1.5).rotate((0, 90, 0)).translate((x, -size * 0.2, 8.5))
        for x in (-wide_mm / 2 - 5, wide_mm / 2 + 5)
    ]
    handle = box((wide_mm + 12, size * 0.9, 3), (0, size * 0.25, 17))
    body = union([*frame, *axles, *wheels, handle])
    matrix = frame_matrix((1, 0, 0), (0, *tangent), (x_mm, *origin))
    if np.cross((1, 0, 0), (0, *tangent)) @ (0, *outward) < 0:
        matrix = frame_matrix((1, 0, 0), (0, *(-tangent)), (x_mm, *origin))
    piece = ClampBody(name=name, body=body, material=Material.ZINC, give_mm=0.05)
    return (piece.placed(matrix),)


def _cradle(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """Saddles, a sole plate and straps; the sole's underside is z = 0."""
    slabs = stations(rng, work, float(rng.uniform(12, 28)))
    wrap, down = _pick_nest(rng, work, slabs)
    pose = lay_down(rng, work, down, work.radius_mm + float(rng.uniform(8, 20)))
    sole = float(rng.uniform(10, 20))
    pose = Transform.from_parts("table", "motor", pose.rotation, pose.translation_mm + (0, 0, sole))
    axis = float(pose.translation_mm[2])
    style = int(rng.integers(3))
    material = (Material.WOOD, Material.GREY_PLASTIC, Material.CAST_ALUMINIUM)[style]
    half = work.radius_mm + float(rng.uniform(10, 26))
    pieces: list[ClampBody] = []
    for index, slab in enumerate(slabs):
        body = _saddle(along_x(pose, slab), axis, work.radius_mm, wrap, half)
        pieces.append(ClampBody(name=f"saddle_{index}", body=body, material=material))
    posed = work.posed(pose)
    low, high = along_x(pose, (work.yoke_low_mm, work.yoke_high_mm))
    strap_half = half + float(rng.uniform(4, 12))
    spots, widest = _strap_places(rng, posed, (low, high))
    for index, x in enumerate(spots):
        near = posed.within((0, x - 21, x + 21))
        wide = max(
            strap_half,
            posed.support_any((0, 1, 0), near) + 2,
            posed.support_any((0, -1, 0), near) + 2,
        )
        if wide > strap_half + 45:
            raise InfeasibleError("the motor is too wide for straps")
        pieces += _strap(rng, work, pose, f"strap_{index}", x, (wide, sole), widest)
    reach = max(float(np.abs(np.asarray(p.body.bounding_box())[[1, 4]]).max()) for p in pieces)
    ends = [np.asarray(p.body.bounding_box()) for p in pieces]
    x_low = min(low, *(float(box_[0]) for box_ in ends)) - 12
    x_high = max(high, *(float(box_[3]) for box_ in ends)) + 12
    plate = bevelled_box(
        (x_high - x_low, 2 * reach + 12, sole), 1, (0.5 * (x_low + x_high), 0, sole / 2)
    )
    sole_material = Material.WOOD if style == 0 else Material.PAINTED_STEEL
    pieces.append(ClampBody(name="sole", body=plate, material=sole_material, give_mm=0.05))
    size = int(rng.choice([6, 8, 10]))
    heads = [
        (socket_screw(size) if rng.random() < 0.5 else hex_screw(size)).translate((x, y, sole))
        for x in (x_low + 9, x_high - 9)
        for y in (-reach + 4, reach - 4)
    ]
    pieces.append(
        ClampBody(name="sole_screws", body=union(heads), material=Material.ZINC, give_mm=0.05)
    )
    return Assembly(bodies=tuple(pieces), table_from_motor=pose)


def build_strap_cradle(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A level cradle with straps."""
    return _cradle(work, rng)


def _stop(
    rng: np.random.Generator, work: Workpiece, posed: PosedPoints, axis_mm: float
) -> ClampBody:
    """An upright plate that touches the end of a lying motor at +x.

    Raises:
        InfeasibleError: What it would touch must not be pressed on.
    """
    central = posed.within((1, -0.8 * work.radius_mm, 0.8 * work.radius_mm), (2, 0, 1e9))
    end = posed.support((1, 0, 0), central) - PRESS_MM
    thick = float(rng.uniform(8, 16))
    tall = axis_mm + float(rng.uniform(0.0, 0.4)) * work.radius_mm
    body = bevelled_box((thick, 1.3 * work.radius_mm, tall), 1, (end + thick / 2, 0, tall / 2))
    return ClampBody(name="stop", body=body, material=Material.PAINTED_STEEL, give_mm=1.5)


def build_tilted_cradle(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A cradle with straps on a slope of 20 to 60 degrees, with a stop at the lower end."""
    level = _cradle(work, rng)
    boxes = [np.asarray(piece.body.bounding_box()) for piece in level.bodies]
    sole = next(piece for piece in level.bodies if piece.name == "sole")
    bounds = np.asarray(sole.body.bounding_box())
    posed = work.posed(level.table_from_motor)
    axis = float(level.table_from_motor.translation_mm[2])
    pieces = list(level.bodies)
    end = float(bounds[3])
    try:
        stop = _stop(rng, work, posed, axis)
    except InfeasibleError:
        # terminals or the pinion are at that end; the straps have to do
        stop = None
    if stop is not None:
        pieces.append(stop)
        end = max(end, float(np.asarray(stop.body.bounding_box())[3]))
    x_low, x_high = float(bounds[0]), end
    if x_high > float(bounds[3]) + 0.1:
        bridge = box((x_high - x_low, 1.3 * work.radius_mm, float(bounds[5]) - 0.5)).translate(
            (0.5 * (x_low + x_high), 0, 0.5 * (float(bounds[5]) - 0.5))
        )
        pieces.append(
            ClampBody(name="bridge", body=bridge, material=Material.PAINTED_STEEL, give_mm=0.05)
        )
    slope = float(rng.uniform(20, 60))
    tilt = turn_about_y(slope)
    # lowest of all that hangs over the lower edge decides the height
    lowest = min(
        float((tilt[:3, :3] @ corner)[2])
        for box_ in boxes
        for corner in ((box_[3], 0, box_[2]), (x_high, 0, 0))
    )
    lowest = min(
        lowest, work.posed(Transform("table", "table", tilt) @ level.table_from_motor).lowest()
    )
    lift = -lowest + float(rng.uniform(3, 20))
    tilt[2, 3] = lift
    moved = level.moved(Transform("table", "table", tilt))
    bodies = [piece.placed(tilt) for piece in pieces]
    closed = rng.random() < 0.4
    wide = float(bounds[4] - bounds[1])
    bodies += wedge_bodies(rng, tilt, (x_low, x_high), wide, closed=closed)
    return centred(Assembly(bodies=tuple(bodies), table_from_motor=moved.table_from_motor))
