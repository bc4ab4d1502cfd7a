"""What lies around a clamp: tools, screws, blocks, boxes, other parts, cables."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.factory.clamps.assembly import ClampBody
from boltpose.factory.clamps.contact import BoxedBody, boxed
from boltpose.factory.clamps.fasteners import (
    HEX_ACROSS_MM,
    any_screw,
    bevelled_box,
    chamfered_hexagon,
    socket_screw,
)
from boltpose.factory.clamps.plates import Ground
from boltpose.factory.model import Material
from boltpose.factory.solids import (
    Manifold,
    box,
    cylinder,
    hull,
    polar,
    prism,
    regular_polygon,
    tube,
    union,
)

CLEARANCE_MM = 6.0
"""Between the boxes around what lies about and the boxes around clamp and motor."""

Thing = tuple[Manifold, Material]


def _ring_spanner(rng: np.random.Generator) -> Thing:
    """An open and ring spanner, lying flat."""
    size = float(rng.choice([8, 10, 13, 16, 17]))
    long = 7 * size + 50
    thick = 0.45 * size
    ring = cylinder(0.85 * size, 0, thick).translate((long / 2, 0, 0))
    jaw = cylinder(1.05 * size, 0, 0.9 * thick).translate((-long / 2, 0, 0))
    shaft = bevelled_box((long, 0.75 * size, 0.7 * thick), 0.8, (0, 0, 0.45 * thick))
    hole = prism(regular_polygon(12, size), -1, thick + 1).translate((long / 2, 0, 0))
    mouth = box((2 * size, size, 3 * thick), (-long / 2 - 0.75 * size, 0, 0))
    body = union([ring, jaw, shaft]) - hole - mouth
    return body, Material.ZINC


def _screwdriver(rng: np.random.Generator) -> Thing:
    """A screwdriver lying on its handle."""
    radius = float(rng.uniform(11, 16))
    long = float(rng.uniform(80, 110))
    blade = float(rng.uniform(70, 140))
    grip = union(
        [
            cylinder(radius, 0, 0.7 * long),
            cylinder(radius, 0.7 * long, 0.85 * long, top_radius_mm=0.65 * radius),
            cylinder(0.65 * radius, 0.85 * long, long),
        ]
    )
    grooves = [
        cylinder(0.22 * radius, 6, 0.66 * long).translate((*polar(1.05 * radius, 60 * k), 0))
        for k in range(6)
    ]
    rod = cylinder(0.28 * radius, long - 1, long + blade)
    tip = hull([cylinder(0.28 * radius, long + blade - 1, long + blade),
                box((0.7 * radius, 1, 1), (0, 0, long + blade + 8))])  # fmt: skip
    body = union([grip - union(grooves), rod, tip])
    return body.rotate((0, 90, 0)).translate((-(long + blade) / 2, 0, radius)), (
        Material.BLACK_PLASTIC if rng.random() < 0.5 else Material.GREY_PLASTIC
    )


def _hex_key(rng: np.random.Generator) -> Thing:
    """An L-shaped hexagon key."""
    size = float(rng.choice([4, 5, 6, 8]))
    long, short = 14 * size + 20, 5 * size + 8
    leg = prism(regular_polygon(6, size, 30), 0, 1)
    first = leg.scale((1, 1, long)).rotate((0, 90, 0))
    second = leg.scale((1, 1, short)).rotate((-90, 0, 0))
    joint = Manifold.sphere(0.58 * size, 16)
    return union([first, second, joint]).translate((-long / 2, 0, 0.58 * size)), Material.BARE_STEEL


def _loose_screw(rng: np.random.Generator) -> Thing:
    """A screw lying on its side or standing on its head."""
    size = int(rng.choice([5, 6, 8, 10, 12]))
    long = float(rng.uniform(2, 7)) * size
    shank = cylinder(size / 2, -long, 1)
    standing = rng.random() < 0.4
    if standing:
        head = chamfered_hexagon(HEX_ACROSS_MM[size], 0.65 * size)
        return (head + shank).rotate((180, 0, 0)).translate((0, 0, 0.65 * size)), Material.ZINC
    body = (any_screw(rng, size) + shank).rotate((0, 90, 0))
    return body.translate((0, 0, -float(np.asarray(body.bounding_box())[2]))), Material.ZINC


def _loose_nut(rng: np.random.Generator) -> Thing:
    """A nut or a stack of two."""
    size = int(rng.choice([6, 8, 10, 12, 16]))
    height = 0.85 * size
    nut = chamfered_hexagon(HEX_ACROSS_MM[size], height, both_ends=True)
    nut -= cylinder(0.45 * size, -1, height + 1)
    if rng.random() < 0.3:
        nut += nut.rotate((0, 0, 20)).translate((0.2 * size, 0, height - 0.01))
    return nut, Material.ZINC


def _block(rng: np.random.Generator) -> Thing:
    """A parallel, a gauge block or a wooden block."""
    size = (float(rng.uniform(20, 90)), float(rng.uniform(12, 50)), float(rng.uniform(8, 55)))
    body = bevelled_box(size, 1.0, (0, 0, size[2] / 2))
    if rng.random() < 0.4:
        radius = 0.25 * min(size[0], size[1])
        body -= cylinder(radius, -1, size[2] + 1)
    material = (Material.BARE_STEEL, Material.WOOD, Material.CAST_ALUMINIUM)[rng.integers(3)]
    return body, material


def _tray(rng: np.random.Generator) -> Thing:
    """An open box with some screws in it."""
    long, wide = float(rng.uniform(70, 160)), float(rng.uniform(50, 110))
    tall = float(rng.uniform(20, 60))
    body = bevelled_box((long, wide, tall), 1.5, (0, 0, tall / 2))
    body -= box((long - 5, wide - 5, tall), (0, 0, tall / 2 + 2.5))
    inside = [
        any_screw(rng, 8)
        .rotate((0, 90, float(rng.uniform(0, 360))))
        .translate((float(rng.uniform(-0.3, 0.3)) * long, float(rng.uniform(-0.3, 0.3)) * wide, 8))
        for _ in range(int(rng.integers(0, 6)))
    ]
    return union([body, *inside]), Material.GREY_PLASTIC


def _old_part(rng: np.random.Generator) -> Thing:
    """Another part: a pulley, a bearing ring, a stepped shaft or a can."""
    kind = int(rng.integers(4))
    radius = float(rng.uniform(20, 42))
    if kind == 0:
        tall = float(rng.uniform(14, 30))
        grooves = [tube(radius + 1, 0.86 * radius, z, z + 3) for z in np.arange(3, tall - 4, 6.0)]
        hub = cylinder(0.35 * radius, 0, tall + 6) - cylinder(0.2 * radius, -1, tall + 8)
        wheel = cylinder(radius, 0, tall) - cylinder(0.7 * radius, 0.4 * tall, tall + 1)
        return wheel - union(grooves) - cylinder(0.2 * radius, -1, tall) + hub, Material.CAST_IRON
    if kind == 1:
        tall = 0.4 * radius
        rings = [tube(radius, 0.82 * radius, 0, tall), tube(0.62 * radius, 0.42 * radius, 0, tall)]
        balls = [
            Manifold.sphere(0.13 * radius, 16).translate((*polar(0.72 * radius, 36 * k), tall / 2))
            for k in range(10)
        ]
        web = tube(0.83 * radius, 0.61 * radius, 0.4 * tall, 0.6 * tall)
        return union([*rings, web, *balls]), Material.BARE_STEEL
    if kind == 2:
        long = float(rng.uniform(90, 180))
        shaft = union(
            [
                cylinder(0.25 * radius, 0, long),
                cylinder(0.5 * radius, 0.2 * long, 0.75 * long),
                cylinder(0.36 * radius, 0.1 * long, 0.9 * long),
            ]
        )
        return shaft.rotate((0, 90, 0)).translate((-long / 2, 0, 0.5 * radius)), Material.BARE_STEEL
    tall = float(rng.uniform(60, 130))
    can = cylinder(radius, 0, tall) + cylinder(0.94 * radius, tall - 1, tall + 5)
    cap = cylinder(0.3 * radius, tall + 4, tall + 16)
    return can + cap, Material.PAINTED_STEEL


def _cable(rng: np.random.Generator) -> Thing:
    """A cable in bends on the plate."""
    radius = float(rng.uniform(2.5, 4.5))
    count = int(rng.integers(8, 16))
    heading = 0.0
    at = np.zeros(2)
    beads = [Manifold.sphere(radius, 12)]
    curl = float(rng.uniform(-0.5, 0.5))
    for _ in range(count):
        heading += curl + float(rng.uniform(-0.25, 0.25))
        at = at + 12 * np.array([math.cos(heading), math.sin(heading)])
        beads.append(Manifold.sphere(radius, 12).translate((float(at[0]), float(at[1]), 0)))
    body = union([hull([one, other]) for one, other in itertools.pairwise(beads)])
    return body.translate((0, 0, radius)), Material.RUBBER


def _socket(rng: np.random.Generator) -> Thing:
    """A spanner socket, standing or lying."""
    size = float(rng.choice([10, 13, 16, 19]))
    tall = 1.8 * size + 8
    body = cylinder(0.75 * size, 0, tall) - prism(regular_polygon(6, size), 0.5 * tall, tall + 1)
    body -= box((6.4, 6.4, 16))
    if rng.random() < 0.5:
        return body, Material.ZINC
    return body.rotate((0, 90, 0)).translate((0, 0, 0.75 * size)), Material.ZINC


def _bolted_stop(rng: np.random.Generator) -> Thing:
    """A stop block of another set-up, bolted down."""
    size = (float(rng.uniform(30, 60)), float(rng.uniform(20, 34)), float(rng.uniform(14, 36)))
    screws = [socket_screw(8).translate((x * size[0], 0, size[2])) for x in (-0.28, 0.28)]
    return union([bevelled_box(size, 1, (0, 0, size[2] / 2)), *screws]), Material.CAST_IRON


_THINGS: tuple[Callable[[np.random.Generator], Thing], ...] = (
    _ring_spanner,
    _screwdriver,
    _hex_key,
    _loose_screw,
    _loose_screw,
    _loose_nut,
    _loose_nut,
    _block,
    _tray,
    _old_part,
    _cable,
    _socket,
    _bolted_stop,
)


def scatter_clutter(
    rng: np.random.Generator, ground: Ground, standing: Sequence[BoxedBody]
) -> tuple[ClampBody, ...]:
    """Put some things around, on the base plate or on the table, clear of clamp and motor.

    Args:
        rng: Source of number, kinds and places.
        ground: Base plate and table.
        standing: What must not be touched, frame `table`.

    Returns:
        The things that found a place; may be none.
    """
    keep_out = [(body.low, body.high) for body in standing]
    bodies: list[ClampBody] = []
    for index in range(int(rng.integers(0, 10))):
        thing, material = _THINGS[int(rng.integers(len(_THINGS)))](rng)
        thing = thing.rotate((0, 0, float(rng.uniform(0, 360))))
        size = boxed(thing)
        half = 0.5 * (size.high - size.low)[:2]
        middle = 0.5 * (size.high + size.low)[:2]
        for _ in range(8):
            spot, z = _draw_spot(rng, ground, half)
            low = np.array([*(spot - half - CLEARANCE_MM), z])
            high = np.array([*(spot + half + CLEARANCE_MM), z + size.high[2]])
            if all((low > other[1]).any() or (high < other[0]).any() for other in keep_out):
                keep_out.append((low, high))
                offset = (float(spot[0] - middle[0]), float(spot[1] - middle[1]), z)
                bodies.append(
                    ClampBody(
                        name=f"clutter_{index}", body=thing.translate(offset), material=material
                    )
                )
                break
    return tuple(bodies)


def _draw_spot(
    rng: np.random.Generator, ground: Ground, half: FloatArray
) -> tuple[FloatArray, float]:
    """A place wholly on the base plate, or wholly beside it on the table, and its height."""
    plate = np.array(ground.plate_half_mm)
    room = plate - half - 2
    if rng.random() < 0.75 and (room > 0).all():
        return rng.uniform(-1, 1, size=2) * room, 0.0
    spot = rng.uniform(-1, 1, size=2) * (plate + 120)
    axis = int(rng.integers(2))
    side = 1.0 if rng.random() < 0.5 else -1.0
    spot[axis] = side * (plate[axis] + half[axis] + float(rng.uniform(4, 120)))
    return spot, ground.table_mm
