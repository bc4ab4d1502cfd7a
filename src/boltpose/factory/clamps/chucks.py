"""Three-jaw chucks: flat on the table, or tilted on a dividing head."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boltpose.factory.clamps.assembly import (
    PRESS_MM,
    Assembly,
    ClampBody,
    InfeasibleError,
    frame_matrix,
    table_pose,
    turn_about_y,
)
from boltpose.factory.clamps.fasteners import bevelled_box, hex_screw, socket_screw
from boltpose.factory.clamps.workpiece import Workpiece
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, hull, prism, regular_polygon, union
from boltpose.geometry.transforms import Transform


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chuck:
    """Sizes of a chuck; its face is z = 0 and its axis is z."""

    radius_mm: float
    thick_mm: float
    bore_mm: float
    jaw_width_mm: float
    jaw_tall_mm: float
    jaw_long_mm: float
    first_deg: float
    """Polar angle of the first jaw."""


def _stepped_jaw(chuck: _Chuck, touch_mm: float) -> Manifold:
    """A jaw along +x whose innermost face is at `touch_mm`, with steps outwards."""
    long, tall, wide = chuck.jaw_long_mm, chuck.jaw_tall_mm, chuck.jaw_width_mm
    profile = [
        (0.0, 0.0), (long, 0.0), (long, 0.34 * tall), (0.68 * long, 0.34 * tall),
        (0.68 * long, 0.68 * tall), (0.36 * long, 0.68 * tall), (0.36 * long, tall), (0.0, tall),
    ]  # fmt: skip
    body = prism(profile, -wide / 2, wide / 2).rotate((90, 0, 0))
    # the gripping edge is narrowed, so that three jaws meet round a thin part
    for sign in (-1, 1):
        corner = prism([(-1, 0), (0.3 * wide, 0), (-1, 0.35 * wide + 0.01)], -1, tall + 1)
        if sign < 0:
            body -= corner.translate((0, -wide / 2, 0))
        else:
            body -= corner.mirror((0, 1, 0)).translate((0, wide / 2, 0))
    groove = box((long * 0.9, 1.6, 3), (0.05 * long + 0.45 * long, 0, 0))
    return (body - groove).translate((touch_mm, 0, 0))


def _chuck_bodies(
    rng: np.random.Generator, chuck: _Chuck, touches_mm: list[float]
) -> tuple[ClampBody, ...]:
    """Body, jaws and screws of a chuck with its face at z = 0."""
    radius, thick, wide = chuck.radius_mm, chuck.thick_mm, chuck.jaw_width_mm
    edge = 3.0
    body = cylinder(radius, -thick, -edge) + cylinder(radius, -edge, 0, top_radius_mm=radius - edge)
    cuts = [cylinder(chuck.bore_mm, -thick - 1, 1)]
    jaws: list[ClampBody] = []
    heads: list[Manifold] = []
    for index, touch in enumerate(touches_mm):
        angle = chuck.first_deg + 120 * index
        slot = box((radius, 0.62 * wide, 16), (0.5 * radius + chuck.bore_mm * 0.5, 0, 0))
        cuts.append(slot.rotate((0, 0, angle)))
        key = prism(regular_polygon(4, 10), 0, 14).rotate((0, 90, 0))
        cuts.append(key.translate((radius - 12, 0, -thick * 0.5)).rotate((0, 0, angle + 60)))
        jaw = _stepped_jaw(chuck, touch)
        jaws.append(
            ClampBody(
                name=f"jaw_{index}",
                body=jaw.rotate((0, 0, angle)),
                material=Material.BARE_STEEL,
            )
        )
        guide = box((chuck.jaw_long_mm, 0.56 * wide, 7.5), (touch + chuck.jaw_long_mm / 2, 0, -3.4))
        jaws.append(
            ClampBody(
                name=f"jaw_guide_{index}",
                body=guide.rotate((0, 0, angle)),
                material=Material.BARE_STEEL,
            )
        )
        size = 8 if wide > 24 else 6
        heads.append(
            socket_screw(size)
            .translate((touch + 0.84 * chuck.jaw_long_mm, 0, 0.34 * chuck.jaw_tall_mm))
            .rotate((0, 0, angle))
        )
        inset = min(0.88 * radius, radius - 10)
        heads.append(socket_screw(6).translate((inset, 0, 0)).rotate((0, 0, angle + 45)))
    material = Material.CAST_IRON if rng.random() < 0.4 else Material.BARE_STEEL
    return (
        ClampBody(name="chuck", body=body - union(cuts), material=material, give_mm=0.05),
        *jaws,
        ClampBody(name="chuck_screws", body=union(heads), material=Material.ZINC, give_mm=0.05),
    )


def _grip(work: Workpiece, rng: np.random.Generator) -> tuple[Transform, _Chuck, list[float]]:
    """A motor standing in a chuck whose face is z = 0, and the radii at which its jaws touch.

    Raises:
        InfeasibleError: What sticks out below is longer than jaws are, or the three jaws find
            no like places to touch.
    """
    nose_down = rng.random() < 0.5
    turn = float(rng.uniform(0, 360))
    sign = -1.0 if nose_down else 1.0
    centre = work.nose_centre_mm if nose_down else np.zeros(2)
    pose = table_pose((0, 0, sign), (1, 0, 0), turn, (0, 0, 0))
    offset = pose.apply((*centre, 0.0))
    pose = Transform.from_parts("table", "motor", pose.rotation, (-offset[0], -offset[1], 0))
    posed = work.posed(pose)
    wide = float(rng.uniform(18, 30))
    # yoke and nose begin at these heights above the motor's lowest point
    low = posed.lowest()
    if nose_down:
        begin = low + float(rng.uniform(0, 3))
        end = -work.flange_front_mm
    else:
        begin, end = work.yoke_low_mm, work.yoke_high_mm
    gap = float(rng.uniform(1.5, 8))
    room = end - begin
    if room < 12:
        raise InfeasibleError("too short for jaws")
    overlap = float(rng.uniform(0.35, 0.75)) * min(room, 45)
    tall = begin + overlap - low + gap
    if not 14 < tall < 80:
        raise InfeasibleError("jaws would have to be too tall")
    base = low - gap
    points = posed.points
    first = float(rng.uniform(0, 120))
    touches: list[float] = []
    for index in range(3):
        angle = math.radians(first + 120 * index)
        outward = points[:, 0] * math.cos(angle) + points[:, 1] * math.sin(angle)
        across = points[:, 1] * math.cos(angle) - points[:, 0] * math.sin(angle)
        mask = (np.abs(across) < 0.2 * wide) & (outward > 0) & (points[:, 2] < base + tall)
        touches.append(posed.support((math.cos(angle), math.sin(angle), 0), mask) - PRESS_MM)
    if max(touches) - min(touches) > 2.5 or min(touches) < 9:
        raise InfeasibleError("jaws would touch at unlike radii")
    long = float(rng.uniform(36, 62))
    radius = max(max(touches) + long * float(rng.uniform(0.7, 0.95)), 60.0)
    chuck = _Chuck(
        radius_mm=radius,
        thick_mm=float(rng.uniform(45, 75)),
        bore_mm=max(8.0, 0.3 * radius),
        jaw_width_mm=wide,
        jaw_tall_mm=tall,
        jaw_long_mm=long,
        first_deg=first,
    )
    up = Transform.from_parts(
        "table", "motor", pose.rotation, pose.translation_mm + (0.0, 0.0, -base)
    )
    return up, chuck, touches


def build_vertical_chuck(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A chuck flat on the base plate; it grips the yoke from behind or the nose."""
    pose, chuck, touches = _grip(work, rng)
    lift = chuck.thick_mm
    up = frame_matrix((1, 0, 0), (0, 1, 0), (0, 0, lift))
    pieces = [piece.placed(up) for piece in _chuck_bodies(rng, chuck, touches)]
    if rng.random() < 0.7:
        flange = cylinder(chuck.radius_mm + float(rng.uniform(16, 28)), 0, 14)
        pieces.append(ClampBody(name="chuck_flange", body=flange, material=Material.CAST_IRON))
        screws = [
            hex_screw(10).translate((chuck.radius_mm + 8.5, 0, 14)).rotate((0, 0, 15 + 60 * k))
            for k in range(6)
        ]
        pieces.append(ClampBody(name="flange_screws", body=union(screws), material=Material.ZINC))
    return Assembly(bodies=tuple(pieces), table_from_motor=Transform("table", "table", up) @ pose)


def build_tilted_chuck(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A chuck on a dividing head, its axis 25 degrees to level."""
    pose, chuck, touches = _grip(work, rng)
    tilt = 90.0 if rng.random() < 0.35 else float(rng.uniform(25, 80))
    pieces = list(_chuck_bodies(rng, chuck, touches))
    # the drum behind the chuck turns about y between two cheeks
    drum_radius = min(0.7 * chuck.radius_mm, 70.0)
    back = -chuck.thick_mm - drum_radius
    drum_half = 0.55 * chuck.radius_mm
    spindle = cylinder(0.6 * chuck.radius_mm, back, -chuck.thick_mm + 1)
    drum = cylinder(drum_radius, -drum_half, drum_half).rotate((90, 0, 0)).translate((0, 0, back))
    pieces.append(
        ClampBody(name="drum", body=spindle + drum, material=Material.CAST_IRON, give_mm=0.05)
    )
    turn = turn_about_y(tilt)
    turn[:3, 3] = -turn[:3, :3] @ (0, 0, back)
    moved = [piece.placed(turn) for piece in pieces]
    lying = Transform("table", "table", turn) @ pose
    lowest = min(
        work.posed(lying).lowest(),
        *(float(np.asarray(piece.body.bounding_box())[2]) for piece in moved),
        -drum_radius,
    )
    pivot = -lowest + float(rng.uniform(4, 20))
    up = frame_matrix((1, 0, 0), (0, 1, 0), (0, 0, pivot))
    bodies = [piece.placed(up) for piece in moved]
    cheek_thick = float(rng.uniform(16, 26))
    heads: list[Manifold] = []
    for index, sign in enumerate((-1, 1)):
        y = sign * (drum_half + 0.5 + cheek_thick / 2)
        round_end = cylinder(0.8 * drum_radius, -cheek_thick / 2, cheek_thick / 2)
        foot = box((2.0 * drum_radius, cheek_thick, 14), (-0.3 * drum_radius, y, 7))
        cheek = hull([round_end.rotate((90, 0, 0)).translate((0, y, pivot)), foot])
        bodies.append(ClampBody(name=f"cheek_{index}", body=cheek, material=Material.PAINTED_STEEL))
        ledge = y + sign * (cheek_thick / 2 + 9)
        bodies.append(
            ClampBody(
                name=f"cheek_foot_{index}",
                body=bevelled_box((2.0 * drum_radius, 24, 13), 1, (-0.3 * drum_radius, ledge, 6.5)),
                material=Material.PAINTED_STEEL,
            )
        )
        heads += [
            hex_screw(10).translate((-0.3 * drum_radius + dx, ledge + sign * 2, 13))
            for dx in (-0.7 * drum_radius, 0.7 * drum_radius)
        ]
        lock = hex_screw(16).rotate((-90 * sign, 0, 0))
        heads.append(lock.translate((0, y + sign * cheek_thick / 2, pivot)))
    bodies.append(ClampBody(name="head_screws", body=union(heads), material=Material.ZINC))
    return Assembly(bodies=tuple(bodies), table_from_motor=Transform("table", "table", up) @ lying)
