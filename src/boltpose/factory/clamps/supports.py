"""Clamps that touch at points: pins, locators and swing clamps; step clamps; centres."""

from __future__ import annotations

import math

import numpy as np

from boltpose.factory.clamps.assembly import (
    PRESS_MM,
    Assembly,
    ClampBody,
    InfeasibleError,
    placed,
    table_pose,
    turn_about_z,
)
from boltpose.factory.clamps.fasteners import (
    bevelled_box,
    chamfered_hexagon,
    hex_screw,
    knurled_knob,
    nut_on_stud,
)
from boltpose.factory.clamps.workpiece import TOUCHABLE, PosedPoints, Workpiece
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, cylinder, hull, prism, regular_polygon, union
from boltpose.geometry.transforms import Transform


def _ball_height(posed: PosedPoints, x_mm: float, y_mm: float, radius_mm: float) -> float:
    """Height of the middle of a ball that touches the motor from below.

    Raises:
        InfeasibleError: Nothing is above, or nothing to rest on.
    """
    square = (posed.points[:, 0] - x_mm) ** 2 + (posed.points[:, 1] - y_mm) ** 2
    over = square < radius_mm**2
    if over.sum() < 4:
        raise InfeasibleError("nothing over the pin")
    heights = posed.points[over, 2] - np.sqrt(radius_mm**2 - square[over])
    lowest = int(np.argmin(heights))
    if posed.labels[over][lowest] not in TOUCHABLE:
        raise InfeasibleError("a pin would carry a bolt, terminal or gear")
    # the contact must be near the pin's axis, or the motor would slide off
    if square[over][lowest] > (0.8 * radius_mm) ** 2:
        raise InfeasibleError("too steep for a pin")
    return float(heights[lowest])


def _domed_pin(
    rng: np.random.Generator, name: str, x_mm: float, y_mm: float, centre_mm: float, ball_mm: float
) -> ClampBody:
    """An upright pin with a round top."""
    shaft = 0.93 * ball_mm
    ball = Manifold.sphere(ball_mm, 40).translate((0, 0, centre_mm + PRESS_MM))
    ball = ball.trim_by_plane((0, 0, 1), centre_mm)
    body = [ball, cylinder(shaft, 0, centre_mm + 0.35 * ball_mm)]
    collar = float(rng.uniform(6, 12))
    if rng.random() < 0.6:
        body.append(prism(regular_polygon(6, 3.2 * ball_mm), 0, collar))
    else:
        body.append(cylinder(2.1 * ball_mm, 0, collar))
    return ClampBody(
        name=name,
        body=union(body).translate((x_mm, y_mm, 0)),
        material=Material.BARE_STEEL,
        give_mm=0.8,
    )


def _support_pins(
    rng: np.random.Generator, posed: PosedPoints, x_mm: tuple[float, float], half_mm: float
) -> list[ClampBody]:
    """Four pins under a lying motor, two and two on both sides of its axis."""
    pins: list[ClampBody] = []
    length = x_mm[1] - x_mm[0]
    ball = float(rng.uniform(5, 9))
    for index in range(4):
        end, side = index % 2, (index // 2) * 2 - 1
        for _ in range(25):
            share = float(rng.uniform(0.05, 0.36))
            x = x_mm[0] + length * (share if end == 0 else 1 - share)
            y = side * float(rng.uniform(0.2, 0.68)) * half_mm
            try:
                centre = _ball_height(posed, x, y, ball)
            except InfeasibleError:
                continue
            if centre > 14:
                pins.append(_domed_pin(rng, f"pin_{index}", x, y, centre, ball))
                break
    if len(pins) < 3:
        raise InfeasibleError("no three places for pins")
    return pins


def _swing_clamp(
    rng: np.random.Generator, name: str, posed: PosedPoints, x_mm: float, y_mm: float, side: float
) -> list[ClampBody]:
    """A round column beside the motor with an arm whose pad presses on its top."""
    pad = float(rng.uniform(5, 8))
    top = posed.top_at(x_mm, y_mm, pad) - PRESS_MM
    column = float(rng.uniform(11, 17))
    beside = posed.within((0, x_mm - column - 8, x_mm + column + 8))
    reach = posed.support_any((0, side, 0), beside) - side * y_mm + column + rng.uniform(4, 14)
    arm = top + float(rng.uniform(8, 16))
    thick = float(rng.uniform(12, 17))
    bar = hull(
        [cylinder(column, arm, arm + thick).translate((reach, 0, 0)), cylinder(9, arm, arm + thick)]
    )
    pad_body = cylinder(pad, top, top + 4) + cylinder(0.75 * pad, top + 3, arm + 1)
    screw = nut_on_stud(8, 18).translate((0, 0, arm + thick))
    cap = nut_on_stud(12, 18).translate((reach, 0, arm + thick))
    post = [cylinder(column * 0.8, 0, arm + 1), cylinder(column * 1.15, 0, 0.55 * arm)]
    foot = bevelled_box((column * 4, column * 3.2, 14), 1, (0, 0, 7))
    heads = [hex_screw(8).translate((sign * column * 1.55, 0, 14)) for sign in (-1, 1)]
    pieces = [
        ClampBody(name=f"{name}_arm", body=bar, material=Material.BARE_STEEL, give_mm=0.05),
        ClampBody(name=f"{name}_pad", body=pad_body, material=Material.RUBBER, give_mm=2.5),
        ClampBody(
            name=f"{name}_post",
            body=union([*post, foot, *heads]).translate((reach, 0, 0)),
            material=Material.PAINTED_STEEL,
            give_mm=0.05,
        ),
        ClampBody(name=f"{name}_nuts", body=screw + cap, material=Material.ZINC, give_mm=0.05),
    ]
    return list(placed(pieces, turn_about_z(90 * side, (x_mm, y_mm, 0))))


def build_pin_fixture(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """Pins below, a stop at one end, swing clamps above; the motor nearly level, at any roll."""
    slope = math.radians(float(rng.uniform(-12, 12)))
    sign = 1.0 if rng.random() < 0.5 else -1.0
    axis = np.array([sign * math.cos(slope), 0, math.sin(slope)])
    down = np.array([sign * math.sin(slope), 0, -math.cos(slope)])
    # y of frame `motor` is the solenoid's side; straight below it would be out of sight
    roll = 270.0 + float(rng.uniform(-115, 115))
    middle = 0.5 * (work.yoke_low_mm + work.yoke_high_mm)
    pose = table_pose(axis, down, roll, -middle * axis)
    lift = -work.posed(pose).lowest() + float(rng.uniform(22, 45))
    pose = table_pose(axis, down, roll, -middle * axis + (0, 0, lift))
    posed = work.posed(pose)
    ends = sorted(float(pose.apply((0, 0, z))[0]) for z in (work.yoke_low_mm, work.flange_front_mm))
    pieces = _support_pins(rng, posed, (ends[0], ends[1]), work.radius_mm)
    side = 1.0 if rng.random() < 0.5 else -1.0
    count = 2 if ends[1] - ends[0] > 80 else 1
    for index in range(count):
        share = (0.25, 0.72)[index] if count == 2 else 0.5
        x = ends[0] + (share + float(rng.uniform(-0.08, 0.08))) * (ends[1] - ends[0])
        y = float(rng.uniform(-0.25, 0.25)) * work.radius_mm
        pieces += _swing_clamp(rng, f"swing_{index}", posed, x, y, side)
        side = -side
    pieces += _end_stop(rng, posed)
    return Assembly(bodies=tuple(pieces), table_from_motor=pose)


def _end_stop(rng: np.random.Generator, posed: PosedPoints) -> list[ClampBody]:
    """A block with an adjusting screw that touches one end of a lying motor; none if it cannot."""
    side = 1.0 if rng.random() < 0.5 else -1.0
    heights = posed.points[:, 2]
    z = float(rng.uniform(0.35, 0.6)) * float(heights.max() - heights.min()) + heights.min()
    y = float(rng.uniform(-12, 12))
    near = np.hypot(posed.points[:, 1] - y, heights - z) < 6
    try:
        touch = posed.support((side, 0, 0), near) - PRESS_MM
    except InfeasibleError:
        return []
    body = [
        chamfered_hexagon(13, 6, both_ends=True).translate((0, 0, 12)),
        cylinder(6, 0, 6, top_radius_mm=5),
        cylinder(4, 3, 50),
    ]
    screw = union(body).rotate((0, 90, 0))
    block = bevelled_box((22, 34, z + 14), 1.5, (18 + 11, 0, -z + (z + 14) / 2))
    pieces = [
        ClampBody(name="stop_screw", body=screw, material=Material.BARE_STEEL, give_mm=1.0),
        ClampBody(name="stop_block", body=block, material=Material.CAST_IRON, give_mm=0.05),
    ]
    return list(
        placed(
            pieces,
            turn_about_z(0 if side > 0 else 180, (side * abs(touch) * np.sign(touch * side), y, z)),
        )
    )


def build_centres(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """Two uprights press plungers on both ends of the motor; any roll, level or nearly so."""
    turn = float(rng.uniform(0, 360))
    sign = 1.0 if rng.random() < 0.5 else -1.0
    pose = table_pose((sign, 0, 0), (0, 0, -1), turn, (0, 0, 0))
    posed = work.posed(pose)
    height = -posed.lowest() + float(rng.uniform(8, 30))
    nose = pose.apply((*work.nose_centre_mm, 0.0))
    pieces: list[ClampBody] = []
    for index, side in enumerate((-1.0, 1.0)):
        at = nose if side == sign else np.zeros(3)
        radius = float(rng.uniform(5, 9))
        near = np.hypot(posed.points[:, 1] - at[1], posed.points[:, 2] - at[2]) < radius
        touch = posed.support_any((side, 0, 0), near) - PRESS_MM
        arm = float(rng.uniform(22, 45))
        block = float(rng.uniform(24, 40))
        wide = float(rng.uniform(34, 60))
        axis = height + float(at[2])
        rod = [cylinder(0.7 * radius, radius, arm + block + 30), cylinder(radius, 0, radius + 2)]
        knob = knurled_knob(float(rng.uniform(14, 22)), 16).translate((0, 0, arm + block + 18))
        nut = chamfered_hexagon(18, 8, both_ends=True).translate((0, 0, arm - 8))
        tall = axis + 0.5 * wide
        upright = bevelled_box((block, wide, tall), 2, (arm + block / 2, 0, tall / 2 - axis))
        foot = bevelled_box((block + 30, wide + 30, 14), 1, (arm + block / 2, 0, 7 - axis))
        heads = [
            hex_screw(10).translate((arm + block / 2 + dx, dy * (wide / 2 + 7), 14 - axis))
            for dx in (-block / 2 + 4, block / 2 - 4)
            for dy in (-1, 1)
        ]
        turn_x = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
        tip = ClampBody(
            name=f"plunger_{index}",
            body=union([*rod, nut]),
            material=Material.BARE_STEEL,
            give_mm=2.5,
        ).placed(turn_x)
        grip = ClampBody(
            name=f"knob_{index}", body=knob, material=Material.BLACK_PLASTIC, give_mm=0.05
        ).placed(turn_x)
        rest = [
            tip,
            grip,
            ClampBody(
                name=f"upright_{index}",
                body=upright + foot,
                material=Material.PAINTED_STEEL,
                give_mm=0.05,
            ),
            ClampBody(
                name=f"upright_screws_{index}",
                body=union(heads),
                material=Material.ZINC,
                give_mm=0.05,
            ),
        ]
        pieces += placed(
            rest, turn_about_z(0 if side > 0 else 180, (side * touch, float(at[1]), axis))
        )
    up = Transform.from_parts("table", "motor", pose.rotation, (0, 0, height))
    return Assembly(bodies=tuple(pieces), table_from_motor=up)
