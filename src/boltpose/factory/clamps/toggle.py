"""Toggle clamps: a foot, a U-shaped arm with a rubber-tipped spindle, links and a lever."""

from __future__ import annotations

import math

import numpy as np

from boltpose.factory.clamps.assembly import ClampBody
from boltpose.factory.clamps.fasteners import (
    bevelled_box,
    chamfered_hexagon,
    hex_screw,
    socket_screw,
)
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, hull, union


def _pin(radius_mm: float, half_mm: float, x_mm: float, z_mm: float) -> Manifold:
    """A pin across the clamp."""
    pin = cylinder(radius_mm, -half_mm, half_mm).rotate((90, 0, 0))
    return pin.translate((x_mm, 0, z_mm))


def _link(
    start: tuple[float, float], end: tuple[float, float], width_mm: float, y_mm: float, thick: float
) -> Manifold:
    """A flat bar with round ends between two points of the xz-plane."""
    ends = [
        cylinder(width_mm / 2, -thick / 2, thick / 2).rotate((90, 0, 0)).translate((x, y_mm, z))
        for x, z in (start, end)
    ]
    return hull(ends)


def toggle_clamp(
    rng: np.random.Generator, name: str, reach_mm: float, tip_mm: float, foot_mm: float = 0.0
) -> tuple[ClampBody, ...]:
    """A closed toggle clamp.

    Args:
        rng: Source of its proportions.
        name: Prefix of its pieces' names.
        reach_mm: From the middle of the foot to the spindle, along +x.
        tip_mm: Height of the spindle's rubber tip.
        foot_mm: Height of the foot's underside; below tip and arm it stands on a column.

    Returns:
        Its pieces; the tip points down at (reach_mm, 0, tip_mm).
    """
    half = float(rng.uniform(7, 11))
    strip = float(rng.uniform(2.5, 4))
    spindle = float(rng.uniform(14, 30))
    arm_z = tip_mm + spindle
    size = float(rng.uniform(26, 36))
    # the mechanism needs about its own size below the arm; a column makes up for the rest
    base = max(foot_mm + 4, arm_z - size * 1.15)
    steel: list[Manifold] = []
    dark: list[Manifold] = []
    if base - foot_mm > 8:
        column = bevelled_box((size * 1.5, 2 * half + 22, base - foot_mm), 1)
        dark.append(column.translate((-size * 0.3, 0, (base + foot_mm) / 2)))
    plate_z = base if base - foot_mm > 8 else foot_mm
    steel.append(box((size * 1.4, 2 * half + 20, 3), (-size * 0.3, 0, plate_z + 1.5)))
    for x in (-size * 0.8, size * 0.2):
        for y in (-half - 6, half + 6):
            screw = socket_screw(5) if rng.random() < 0.5 else hex_screw(5)
            steel.append(screw.translate((x, y, plate_z + 3)))
    pivot = (0.0, arm_z - 2)
    rear = (-size * 0.75, plate_z + 0.35 * (arm_z - plate_z))
    for y in (-half, half):
        web = [
            _link(pivot, (0.05 * size, plate_z + 4), 12, y, strip),
            _link(rear, (-0.75 * size, plate_z + 4), 12, y, strip),
        ]
        steel.append(hull(web))
    inner = half - strip
    for y in (-inner, inner):
        steel.append(_link((-0.25 * size, arm_z), (reach_mm, arm_z), 11, y, strip))
    lean = float(rng.uniform(60, 112))
    lever = size * float(rng.uniform(2.2, 3.2))
    direction = (math.cos(math.radians(lean)), math.sin(math.radians(lean)))
    knee = (-0.55 * size, arm_z + 4)
    top = (knee[0] + lever * direction[0], knee[1] + lever * direction[1])
    steel.append(_link(rear, knee, 9, 0, 2 * inner - strip))
    steel.append(_link(knee, top, 8, 0, strip + 1))
    steel += [_pin(3, half + 4, *pivot), _pin(2.6, half + 3, *rear), _pin(2.6, half + 1, *knee)]
    grip_from = (knee[0] + 0.45 * lever * direction[0], knee[1] + 0.45 * lever * direction[1])
    grip = hull([_pin(6.5, 7, *grip_from), _pin(6.5, 7, *top)])
    rod = cylinder(3, tip_mm + 5, arm_z + 11)
    nuts = [
        chamfered_hexagon(10, 5, both_ends=True).translate((0, 0, arm_z + dz))
        for dz in (5.5, -10.5)
    ]
    washer = cylinder(inner + strip, arm_z - 5.8, arm_z + 5.7)
    steel += [body.translate((reach_mm, 0, 0)) for body in (rod, washer, *nuts)]
    tip_radius = float(rng.uniform(6, 9))
    tip = cylinder(tip_radius, tip_mm, tip_mm + 7) + cylinder(
        tip_radius, tip_mm + 7, tip_mm + 11, top_radius_mm=4.5
    )
    pieces = [
        ClampBody(name=f"{name}_steel", body=union(steel), material=Material.ZINC, give_mm=0.3),
        ClampBody(
            name=f"{name}_tip",
            body=tip.translate((reach_mm, 0, 0)),
            material=Material.RUBBER,
            give_mm=2.5,
        ),
        ClampBody(name=f"{name}_grip", body=grip, material=Material.BLACK_PLASTIC, give_mm=0.05),
    ]
    if dark:
        pieces.append(
            ClampBody(
                name=f"{name}_column",
                body=union(dark),
                material=Material.PAINTED_STEEL,
                give_mm=0.05,
            )
        )
    return tuple(pieces)
