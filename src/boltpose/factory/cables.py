"""Cable, braid or bar from a terminal stud into the motor, on a way around what stands there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.factory.layout import Layout
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, hull, turned
from boltpose.factory.spec import CableSpec, MotorSpec
from boltpose.factory.sweeps import sweep

_GROMMET_MM = 5.0
_LUG_MM = 2.0
_BARREL_MM = 7.0
_CLEARANCE_MM = 1.0
"""Wanted between cable and everything else."""
_CURVE_POINTS = 28
_TURNS_DEG = (0, 20, -20, 40, -40, 60, -60, 85, -85)
"""Where around the motor the cable may enter, counted from its stud."""
_EMBED_MM = 0.5
_INSIDE_MM = 1.3
"""Where in the barrel the cable starts; ends in one plane would leave crumbs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A cylinder along z that the cable keeps away from, frame `build`."""

    xy: tuple[float, float]
    radius_mm: float
    z_low: float
    z_high: float


def build_cable(
    spec: CableSpec, lug_at_mm: FloatArray, thread_mm: float, motor: MotorSpec, layout: Layout
) -> list[tuple[str, Manifold, Material]]:
    """Build the cable of a motor, its lug and its grommet.

    Of many ways (directions of the lug, places of entry, bulges) the one with the least
    collision, sharpness and length is taken.

    Args:
        spec: The cable.
        lug_at_mm: Shape (3,), frame `build`: on the stud, on the side of the lug that looks at
            the motor.
        thread_mm: Of the stud.
        motor: What it is built onto.
        layout: The motor's stations.

    Returns:
        Cable, lug and grommet, frame `build`; they overlap, the cable comes first.
    """
    way, lug_direction, entry, outward = _choose_way(spec, lug_at_mm, thread_mm, motor, layout)
    up = np.array([0.0, 0.0, -1.0])
    outline, material = _outline(spec)
    scale = np.ones(len(way))
    if spec.kind == "braid":  # a woven band is uneven
        scale = 1 + 0.06 * np.sin(2.1 * np.arange(len(way)))
    cable = sweep(outline, way, first_up=up, scale=scale)
    return [
        ("cable", cable, material),
        ("lug", _lug(spec, thread_mm, lug_at_mm, lug_direction), Material.COPPER),
        ("grommet", _grommet(spec, entry, outward), Material.RUBBER),
    ]


def lug_thickness_mm() -> float:
    """Room that a lug takes on its stud."""
    return _LUG_MM


def _outline(spec: CableSpec) -> tuple[FloatArray, Material]:
    """Cross-section, shape (K, 2): across and away from the motor."""
    radius = spec.radius_mm
    match spec.kind:
        case "cable":
            angles = 2 * math.pi * np.arange(16) / 16
            return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1), Material.RUBBER
        case "braid":
            angles = 2 * math.pi * np.arange(16) / 16
            shape = np.stack([1.25 * np.cos(angles), 0.55 * np.sin(angles)], axis=1)
            return radius * shape, Material.COPPER
        case "bar":
            wide, thick = 1.2 * radius, max(0.3 * radius, 0.75)
            edge = 0.3 * thick
            corners = [
                (wide, thick - edge),
                (wide - edge, thick),
                (edge - wide, thick),
                (-wide, thick - edge),
                (-wide, edge - thick),
                (edge - wide, -thick),
                (wide - edge, -thick),
                (wide, edge - thick),
            ]
            return np.array(corners), Material.COPPER


def _lift(spec: CableSpec) -> float:
    """Height of the cable's middle over the lug's underside."""
    outline, _ = _outline(spec)
    return float(outline[:, 1].max()) + 0.3


def _choose_way(
    spec: CableSpec, lug_at: FloatArray, thread_mm: float, motor: MotorSpec, layout: Layout
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Way of the cable (N, 3), direction of its lug, point of entry, direction out of the motor."""
    obstacles = find_obstacles(motor, layout)
    start_angle = math.degrees(math.atan2(lug_at[1], lug_at[0]))
    radius, stations = _entries(spec, motor, layout)
    first = thread_mm * 1.15
    best: tuple[float, FloatArray, FloatArray, FloatArray, FloatArray] | None = None
    lug_angles = np.radians(start_angle + 180 + 30.0 * np.arange(12))
    lugs = np.stack([np.cos(lug_angles), np.sin(lug_angles), np.zeros(12)], axis=1)
    lift = np.array([0.0, 0.0, -_lift(spec)])
    begin = lug_at + lift + first * lugs
    bend = begin + _BARREL_MM * lugs
    for station in stations:
        for turn in _TURNS_DEG:
            angle = math.radians(start_angle + turn)
            outward = np.array([math.cos(angle), math.sin(angle), 0.0])
            entry = radius * outward + np.array([0.0, 0.0, station])
            mouth = entry + _GROMMET_MM * outward
            for bulge in (0.55, 1.0, 1.5):
                curve = _curves(bend, lugs, mouth, outward, bulge, spec.sag_mm)
                cost = _cost(curve, spec, obstacles) + 0.05 * abs(turn)
                index = int(np.argmin(cost))
                if best is None or cost[index] < best[0] - 1e-9:
                    inside = begin[index] + _INSIDE_MM * lugs[index]
                    head = np.linspace(inside, bend[index], 4)[:-1]
                    tail = np.linspace(mouth, entry - _EMBED_MM * outward, 4)[1:]
                    way = np.concatenate([head, curve[index], tail])
                    best = (float(cost[index]), way, lugs[index], entry, outward)
    assert best is not None
    return best[1:]


def _curves(
    start: FloatArray,
    direction: FloatArray,
    mouth: FloatArray,
    outward: FloatArray,
    bulge: float,
    sag_mm: float,
) -> FloatArray:
    """Cubic Hermite curves from every lug, shape (D, N, 3), to one grommet."""
    distance = np.linalg.norm(mouth - start, axis=1)[:, None, None]
    pull = bulge * (0.9 * distance + 10 + 2 * sag_mm)
    t = np.linspace(0, 1, _CURVE_POINTS)[None, :, None]
    h00, h10 = 2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t
    h01, h11 = -2 * t**3 + 3 * t**2, t**3 - t**2
    return (
        h00 * start[:, None] + h10 * pull * direction[:, None] + h01 * mouth - h11 * pull * outward
    )


def _cost(curves: FloatArray, spec: CableSpec, obstacles: list[Obstacle]) -> FloatArray:
    """How bad each of the curves, shape (D, N, 3), is."""
    need = 1.25 * spec.radius_mm + _CLEARANCE_MM
    steps = np.diff(curves, axis=1)
    lengths = np.linalg.norm(steps, axis=2)
    units = steps / np.maximum(lengths[..., None], 1e-9)
    turns = np.arccos(np.clip((units[:, 1:] * units[:, :-1]).sum(2), -1, 1))
    curvature = turns / np.maximum(0.5 * (lengths[:, 1:] + lengths[:, :-1]), 1e-6)
    sharp = np.maximum(0, curvature.max(axis=1) * 1.5 * spec.radius_mm - 1)
    # the last points come near the motor of necessity
    free = curves[:, :-2]
    hit = np.zeros(len(curves))
    for obstacle in obstacles:
        hit += np.maximum(0, need - obstacle_distance(free, obstacle)).sum(axis=1)
    return lengths.sum(axis=1) + 300 * sharp + 20 * hit


def obstacle_distance(points: FloatArray, obstacle: Obstacle) -> FloatArray:
    """Signed distance of points, shape (..., 3), frame `build`, to a cylinder."""
    beside = np.hypot(points[..., 0] - obstacle.xy[0], points[..., 1] - obstacle.xy[1])
    radial = beside - obstacle.radius_mm
    axial = np.maximum(obstacle.z_low - points[..., 2], points[..., 2] - obstacle.z_high)
    outside = np.hypot(np.maximum(radial, 0), np.maximum(axial, 0))
    return outside + np.minimum(np.maximum(radial, axial), 0)


def _entries(spec: CableSpec, motor: MotorSpec, layout: Layout) -> tuple[float, tuple[float, ...]]:
    """Radius of the mantle that the cable enters, and stations along the axis to choose from."""
    if spec.enters == "rear_cap":
        return layout.cap_radius_mm, (0.5 * (layout.cap_rear_z + layout.yoke_rear_z),)
    rear = layout.yoke_rear_z + max(8.0, 1.9 * spec.radius_mm)
    last = -max(12.0, 0.2 * motor.housing.length_mm)
    beside = layout.terminal_z(motor) - 2.5 * spec.radius_mm
    stations = {min(rear, last), float(np.clip(beside, min(rear, last), last))}
    return motor.housing.radius_mm, tuple(sorted(stations))


def find_obstacles(motor: MotorSpec, layout: Layout) -> list[Obstacle]:
    """Cylinders around yoke, rear cap, bracket, solenoid, plug and the studs without the cable."""
    main = (0.0, 0.0)
    housing, cap = motor.housing.radius_mm, layout.cap_radius_mm
    obstacles = [
        Obstacle(xy=main, radius_mm=housing, z_low=layout.yoke_rear_z, z_high=0),
        Obstacle(xy=main, radius_mm=cap, z_low=layout.cap_rear_z, z_high=layout.yoke_rear_z),
        Obstacle(xy=main, radius_mm=motor.bracket.radius_mm, z_low=0, z_high=layout.flange_front_z),
    ]
    centre = layout.terminal_xy
    face = layout.terminal_z(motor)
    if motor.solenoid is not None:
        reach = max(motor.solenoid.radius_mm, motor.solenoid.flange_radius_mm or 0)
        obstacles += [
            Obstacle(
                xy=layout.solenoid_xy,
                radius_mm=layout.solenoid_cap_radius_mm,
                z_low=layout.solenoid_rear_z,
                z_high=layout.can_rear_z,
            ),
            Obstacle(
                xy=layout.solenoid_xy,
                radius_mm=reach,
                z_low=layout.can_rear_z,
                z_high=layout.solenoid_front_z,
            ),
        ]
    for index, stud in enumerate(motor.terminals.studs):
        if motor.terminals.cable is not None and index == motor.terminals.cable.stud:
            continue
        angle = math.radians(stud.angle_deg)
        at = (
            centre[0] + stud.radius_mm * math.cos(angle),
            centre[1] + stud.radius_mm * math.sin(angle),
        )
        low = face - stud.length_mm - 4
        obstacles.append(Obstacle(xy=at, radius_mm=stud.thread_mm, z_low=low, z_high=face))
    plug = motor.terminals.plug
    if plug is not None:
        width, depth, height = plug.size_mm
        radial, reach = plug.radius_mm, 0.5 * math.hypot(width, depth)
        if plug.on_side:
            mantle = (
                layout.cap_radius_mm if motor.solenoid is None else layout.solenoid_cap_radius_mm
            )
            radial, reach = mantle + 0.5 * height, 0.5 * max(height, width)
            height = -2 * depth
        angle = math.radians(plug.angle_deg)
        at = (centre[0] + radial * math.cos(angle), centre[1] + radial * math.sin(angle))
        ends = sorted((face, face - height))
        obstacles.append(Obstacle(xy=at, radius_mm=reach, z_low=ends[0], z_high=ends[1]))
    return obstacles


def _lug(spec: CableSpec, thread_mm: float, at_mm: FloatArray, direction: FloatArray) -> Manifold:
    """A flat eye around the stud and, for a cable, a barrel that holds it."""
    eye = cylinder(1.0 * thread_mm, 0, _LUG_MM)
    reach = 1.15 * thread_mm
    outline, _ = _outline(spec)
    half = float(outline[:, 0].max())
    tongue = box((0.5, 2 * min(half, 0.9 * thread_mm), _LUG_MM), (reach + 1, 0, _LUG_MM / 2))
    body = hull([eye, tongue])
    if spec.kind == "cable":
        radius = spec.radius_mm + 0.6
        barrel = cylinder(radius, 0, _BARREL_MM).rotate((0, 90, 0))
        flat = box((0.5, 2 * radius, _LUG_MM), (reach + 0.25, 0, _LUG_MM / 2))
        seam = hull([flat, flat.translate((1.5, 0, 0.6 * radius))])
        body = body + barrel.translate((reach, 0, _lift(spec))) + seam
    else:
        thick = float(outline[:, 1].max())
        body += box((3, 2 * half + 0.6, 2 * thick + 0.6), (reach + 1.5, 0, _lift(spec)))
    # frame `lug` has z away from the motor: turn it to look along -z of frame `build`
    angle = math.degrees(math.atan2(direction[1], direction[0]))
    turned_over = body.rotate((180, 0, 0)).rotate((0, 0, angle))
    return turned_over.translate(tuple(at_mm.tolist()))


def _grommet(spec: CableSpec, entry: FloatArray, outward: FloatArray) -> Manifold:
    outline, _ = _outline(spec)
    half = float(np.abs(outline).max())
    body = turned(
        [
            (0, -3),
            (half + 3, -3),
            (half + 3, 1.6),
            (half + 2.2, 2.4),
            (half + 1.2, 2.6),
            (half + 0.8, _GROMMET_MM - 0.5),
            (half + 0.3, _GROMMET_MM),
            (0, _GROMMET_MM),
        ]
    )
    angle = math.degrees(math.atan2(outward[1], outward[0]))
    return body.rotate((0, 90, 0)).rotate((0, 0, angle)).translate(tuple(entry.tolist()))
