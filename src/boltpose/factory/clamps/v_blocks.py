"""V-blocks under the yoke, toggle clamps from above."""

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
from boltpose.factory.clamps.fasteners import screw_piece
from boltpose.factory.clamps.toggle import toggle_clamp
from boltpose.factory.clamps.workpiece import PosedPoints, Workpiece
from boltpose.factory.model import Material
from boltpose.factory.solids import box, prism
from boltpose.geometry.transforms import Transform


def stations(
    rng: np.random.Generator, work: Workpiece, thick_mm: float
) -> list[tuple[float, float]]:
    """Slabs of the yoke, along its axis, on which it shall lie: two, or one if it is short.

    Raises:
        InfeasibleError: The yoke is shorter than one slab.
    """
    low, high = work.yoke_low_mm + 1, work.yoke_high_mm - 1
    length = high - low
    if length < 2.4 * thick_mm:
        wide = min(length, float(rng.uniform(1.0, 2.2)) * thick_mm)
        if wide < 10:
            raise InfeasibleError("yoke too short")
        start = low + float(rng.uniform(0, 1)) * (length - wide)
        return [(start, start + wide)]
    spare = length - 2.2 * thick_mm
    first = low + float(rng.uniform(0, 0.4)) * spare
    second = high - thick_mm - float(rng.uniform(0, 0.4)) * spare
    return [(first, first + thick_mm), (second, second + thick_mm)]


def lay_down(
    rng: np.random.Generator, work: Workpiece, down_deg: float, shortest_mm: float
) -> Transform:
    """The pose of a motor that lies along x with one side down, end over end at random.

    Args:
        rng: Source of direction and height.
        work: The motor.
        down_deg: Polar angle of the side that looks down.
        shortest_mm: The least height of the axis.

    Returns:
        `table_from_motor`; the middle of the yoke is over the origin.
    """
    sign = 1.0 if rng.random() < 0.5 else -1.0
    middle = 0.5 * (work.yoke_low_mm + work.yoke_high_mm)
    flat = table_pose((sign, 0, 0), (0, 0, -1), down_deg, (-sign * middle, 0, 0))
    drop = -work.posed(flat).lowest()
    height = max(shortest_mm, drop + float(rng.uniform(4, 25)))
    return table_pose((sign, 0, 0), (0, 0, -1), down_deg, (-sign * middle, 0, height))


def along_x(pose: Transform, slab_mm: tuple[float, float]) -> tuple[float, float]:
    """A slab along the motor's axis as an interval of x, for a motor that lies along x."""
    ends = [float(pose.apply((0, 0, z))[0]) for z in slab_mm]
    return min(ends), max(ends)


def v_block(
    rng: np.random.Generator,
    name: str,
    x_mm: tuple[float, float],
    axis_mm: float,
    radius_mm: float,
    half_angle_deg: float,
) -> tuple[ClampBody, ...]:
    """A V-block on z = 0 that carries a cylinder along x.

    Args:
        rng: Source of its proportions.
        name: Prefix of its pieces' names.
        x_mm: Where it begins and ends.
        axis_mm: Height of the cylinder's axis.
        radius_mm: The cylinder's radius.
        half_angle_deg: Half the included angle of the V.
    """
    half = math.radians(half_angle_deg)
    apex = axis_mm - (radius_mm - PRESS_MM) / math.sin(half)
    touch = axis_mm - radius_mm * math.sin(half)
    top = touch + float(rng.uniform(0.1, 0.28)) * radius_mm
    run = (top - apex) * math.tan(half)
    wide = run + float(rng.uniform(5, 16))
    relief = float(rng.uniform(1.5, 3))
    bottom = max(apex - float(rng.uniform(2, 6)), 2.0)
    # the groove narrows to its relief slot where the flanks are that close
    narrow = apex + relief / math.tan(half)
    outline = [
        (-wide, 0), (wide, 0), (wide, top), (run, top), (relief, narrow), (relief, bottom),
        (-relief, bottom), (-relief, narrow), (-run, top), (-wide, top),
    ]  # fmt: skip
    thick = x_mm[1] - x_mm[0]
    # prism stands along z: turn its z to x, its x to y and its y to z
    body = prism(outline, 0, thick).transform(
        np.array([[0.0, 0, 1, x_mm[0]], [1, 0, 0, 0], [0, 1, 0, 0]])
    )
    pieces: list[ClampBody] = []
    if rng.random() < 0.6:
        foot = float(rng.uniform(8, 14))
        ledge = float(rng.uniform(18, 26))
        middle = 0.5 * (x_mm[0] + x_mm[1])
        body += box((thick, 2 * (wide + ledge), foot), (middle, 0, foot / 2))
        size = int(rng.choice([6, 8, 10])) if thick >= 22 else 6
        for index, y in enumerate((-wide - ledge / 2, wide + ledge / 2)):
            pieces.append(screw_piece(rng, f"{name}_screw_{index}", size, (middle, y, foot)))
    material = Material.BARE_STEEL if rng.random() < 0.6 else Material.CAST_IRON
    return (ClampBody(name=name, body=body, material=material), *pieces)


def pick_top(
    rng: np.random.Generator, posed: PosedPoints, x_mm: tuple[float, float], half_width_mm: float
) -> tuple[float, float, float]:
    """A place from above on which a plunger of 10 mm radius can press: x, y and its height."""
    x = float(rng.uniform(*x_mm))
    y = float(rng.uniform(-half_width_mm, half_width_mm))
    return x, y, posed.top_at(x, y, 8)


def side_toggles(
    rng: np.random.Generator, posed: PosedPoints, x_mm: list[float], radius_mm: float
) -> tuple[ClampBody, ...]:
    """Toggle clamps beside a lying motor that press on its top, one for each x."""
    pieces: list[ClampBody] = []
    side = 1.0 if rng.random() < 0.5 else -1.0
    for index, x in enumerate(x_mm):
        y = side * float(rng.uniform(-0.1, 0.15)) * radius_mm
        top = posed.top_at(x, y, 6)
        beside = posed.within((0, x - 30, x + 30))
        width = posed.support_any((0, side, 0), beside)
        reach = width - side * y + float(rng.uniform(34, 60))
        clamp = toggle_clamp(rng, f"toggle_{index}", reach, top - PRESS_MM)
        # the arm points from the foot at the side towards the motor
        turn = -90.0 if side > 0 else 90.0
        pieces += placed(clamp, turn_about_z(turn, (x, y + side * reach, 0)))
        if rng.random() < 0.4:
            side = -side
    return tuple(pieces)


def _pick_v(
    rng: np.random.Generator, work: Workpiece, slabs: list[tuple[float, float]]
) -> tuple[float, float]:
    """Half the V's angle, and which side of the motor looks down.

    Raises:
        InfeasibleError: No side is bare enough even for a wide V.
    """
    half_angle = 45.0 if rng.random() < 0.6 else 60.0
    # the arms of the V reach further round than where they touch
    for angle in (half_angle, 60.0):
        try:
            return angle, work.pick_bare_angle(rng, slabs, 90 - angle + 8)
        except InfeasibleError:
            continue
    raise InfeasibleError("no bare side for a V")


def build_v_blocks(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """One or two V-blocks and one or two toggle clamps."""
    slabs = stations(rng, work, float(rng.uniform(14, 26)))
    half_angle, down = _pick_v(rng, work, slabs)
    shortest = work.radius_mm / math.sin(math.radians(half_angle)) + float(rng.uniform(8, 30))
    pose = lay_down(rng, work, down, shortest)
    height = float(pose.translation_mm[2])
    pieces: list[ClampBody] = []
    for index, slab in enumerate(slabs):
        pieces += v_block(
            rng, f"v_block_{index}", along_x(pose, slab), height, work.radius_mm, half_angle
        )
    low, high = along_x(pose, (work.yoke_low_mm, work.yoke_high_mm))
    if len(slabs) == 2 and rng.random() < 0.4 and high - low > 90:
        spots = [low + (high - low) * share for share in (0.2, 0.8)]
    else:
        spots = [float(rng.uniform(low + 0.3 * (high - low), high - 0.3 * (high - low)))]
    pieces += side_toggles(rng, work.posed(pose), spots, work.radius_mm)
    return Assembly(bodies=tuple(pieces), table_from_motor=pose)
