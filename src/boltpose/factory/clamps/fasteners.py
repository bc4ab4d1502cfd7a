"""Screws and nuts of clamps and fixtures; their class is background, however much they resemble.

All stand on z = 0 (the seat) and look along +z; a stub of the shank reaches below.
"""

from __future__ import annotations

import math

import numpy as np

from boltpose.factory.clamps.assembly import ClampBody
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, prism, regular_polygon, turned, union

HEX_ACROSS_MM = {5: 8.0, 6: 10.0, 8: 13.0, 10: 16.0, 12: 18.0, 16: 24.0}
"""Spanner sizes. Source: ISO 4014 / ISO 4032."""
HEX_HEIGHT_MM = {5: 3.5, 6: 4.0, 8: 5.3, 10: 6.4, 12: 7.5, 16: 10.0}
"""Head heights. Source: ISO 4014."""
SOCKET_MM = {5: (8.5, 4.0), 6: (10.0, 5.0), 8: (13.0, 6.0), 10: (16.0, 8.0), 12: (18.0, 10.0)}
"""Head diameter and key size; the head is as high as the thread is wide. Source: ISO 4762."""

_STUB_MM = 2.0


def chamfered_hexagon(across_mm: float, height_mm: float, *, both_ends: bool = False) -> Manifold:
    """A hexagonal prism with the usual 30 degree chamfer."""
    corner = across_mm / math.sqrt(3)
    run = corner - 0.47 * across_mm
    rise = run * math.tan(math.radians(30))
    low = [(0.0, 0.0), (corner, 0.0)]
    if both_ends:
        low = [(0.0, 0.0), (corner - run, 0.0), (corner, rise)]
    cone = turned([*low, (corner, height_mm - rise), (corner - run, height_mm), (0, height_mm)])
    return prism(regular_polygon(6, across_mm), 0, height_mm) ^ cone


def hex_screw(size: int, *, washer: bool = True) -> Manifold:
    """A hexagon head screw, with or without a washer."""
    head = chamfered_hexagon(HEX_ACROSS_MM[size], HEX_HEIGHT_MM[size])
    stub = cylinder(size / 2, -_STUB_MM, 1)
    if not washer:
        return head + stub
    thick = 0.2 * size
    return union([head.translate((0, 0, thick)), cylinder(1.05 * size, 0, thick + 0.1), stub])


def socket_screw(size: int) -> Manifold:
    """A cap screw with hexagon socket."""
    diameter, key = SOCKET_MM[size]
    edge = 0.06 * size
    radius = diameter / 2
    head = turned([(0, 0), (radius, 0), (radius, size - edge), (radius - edge, size), (0, size)])
    socket = prism(regular_polygon(6, key), 0.5 * size, size + 1)
    return head - socket + cylinder(size / 2, -_STUB_MM, 1)


def nut_on_stud(size: int, stud_mm: float, *, nut_at_mm: float = 0.0) -> Manifold:
    """A nut with washer on a stud that reaches `stud_mm` above the seat."""
    thick = 0.2 * size
    nut = chamfered_hexagon(HEX_ACROSS_MM[size], 0.85 * size, both_ends=True)
    end = 0.08 * size
    stud = turned(
        [(0, -_STUB_MM), (size / 2, -_STUB_MM), (size / 2, stud_mm - end),
         (size / 2 - end, stud_mm), (0, stud_mm)]
    )  # fmt: skip
    washer = cylinder(1.05 * size, nut_at_mm, nut_at_mm + thick + 0.1)
    return union([stud, washer, nut.translate((0, 0, nut_at_mm + thick))])


def any_screw(rng: np.random.Generator, size: int) -> Manifold:
    """A hexagon or socket head, turned at random."""
    kind = rng.integers(3)
    body = socket_screw(min(size, 12)) if kind == 0 else hex_screw(size, washer=kind == 1)
    return body.rotate((0, 0, float(rng.uniform(0, 360))))


def screw_piece(
    rng: np.random.Generator, name: str, size: int, at_mm: tuple[float, float, float]
) -> ClampBody:
    """A screw of a fixture, upright on a seat."""
    material = Material.ZINC if rng.random() < 0.5 else Material.BARE_STEEL
    body = any_screw(rng, size).translate(at_mm)
    return ClampBody(name=name, body=body, material=material, give_mm=0.05)


def thumb_bar(length_mm: float, radius_mm: float) -> Manifold:
    """A sliding bar with end knobs, as on a vice, along x and centred."""
    bar = cylinder(radius_mm, -length_mm / 2, length_mm / 2)
    knobs = [
        Manifold.sphere(1.7 * radius_mm, 24).translate((0, 0, sign * length_mm / 2))
        for sign in (-1, 1)
    ]
    return union([bar, *knobs]).rotate((0, 90, 0))


def bevelled_box(
    size_mm: tuple[float, float, float],
    bevel_mm: float,
    centre_mm: tuple[float, float, float] = (0, 0, 0),
) -> Manifold:
    """A block with broken edges."""
    x, y, z = size_mm
    inset = 2 * bevel_mm
    if bevel_mm <= 0 or inset >= min(size_mm):
        return box(size_mm, centre_mm)
    blocks = [box((x - inset, y - inset, z)), box((x - inset, y, z - inset)),
              box((x, y - inset, z - inset))]  # fmt: skip
    return Manifold.batch_hull(blocks).translate(centre_mm)


def knurled_knob(radius_mm: float, height_mm: float) -> Manifold:
    """A hand knob with lobes, on z = 0."""
    lobes = [
        cylinder(0.3 * radius_mm, 0, height_mm).translate(
            (0.8 * radius_mm * math.cos(angle), 0.8 * radius_mm * math.sin(angle), 0)
        )
        for angle in np.arange(5) * 2 * math.pi / 5
    ]
    return union([cylinder(0.8 * radius_mm, 0, height_mm), *lobes])
