"""Bolts as solids: six heads by their standards, with drives, flanges, washers and shanks.

Frame `bolt`: origin `head_top` on the axis, +z out of the head, head below the plane z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.factory.head_sizes import HEAD_SIZES, WASHERS, HeadSize
from boltpose.factory.solids import (
    Manifold,
    box,
    cylinder,
    hull,
    prism,
    regular_polygon,
    turned,
    union,
)
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind

_CHAMFER_DEG = 30
"""Of the corners of a hexagon against its top face (ISO 4017: 15 to 30)."""
_CHAMFER_CIRCLE = 0.95
"""Diameter of the flat top of a hexagon, in spanner sizes."""
_HOLE_PLAY_MM = 0.15
_HEAD_PLAY_MM = 0.35
_ABOVE_MM = 5
"""How far over the head, and over the rim of its counterbore, everything is cut away."""
_BLIND_MM = 1
"""How much deeper than its bolt a hole is."""
_LOBE_POINTS = 72
_CROWN_POINTS = 7
_OVERLAP_MM = 0.5
_NECK_MM = 0.5
"""Of the shank that stays with a head: the plane of the cut is not the seat's."""
THROUGH_BOLT_MM = 40.0
"""Shanks from this length on are rods along the motor, not screws."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoltSolid:
    """A bolt as a body in frame `bolt`, and the sizes it was made with."""

    body: Manifold
    """Head from z = -head_height_mm to 0, shank below, washer included in the head."""
    across_mm: float
    """Spanner size of a hexagon, diameter of a round head."""
    head_diameter_mm: float
    """Of the circle around the whole head, flange and washer included."""
    head_height_mm: float
    """From the seat to the top face, flange and washer included."""
    shank_radius_mm: float
    shank_mm: float
    """Length below the seat."""


def head_size(spec: BoltSpec) -> HeadSize:
    """Sizes of a bolt's head, the standard's with the overrides of the specification.

    An own spanner size or diameter scales flange, crown and drive with it; an own height scales
    the depth of the drive and the flange.

    Raises:
        ConfigError: The head would be no wider than its thread.
    """
    size = HEAD_SIZES[spec.head][spec.thread_mm]
    across = size.across_mm if spec.across_mm is None else spec.across_mm
    height = size.height_mm if spec.head_height_mm is None else spec.head_height_mm
    if not across > spec.thread_mm:
        raise ConfigError(
            f"across_mm of an M{spec.thread_mm} bolt must be > {spec.thread_mm}, got {across:g}"
        )
    wide, high = across / size.across_mm, height / size.height_mm
    return HeadSize(
        across_mm=across,
        height_mm=height,
        flange_mm=size.flange_mm * wide,
        flange_edge_mm=size.flange_edge_mm * high,
        crown_mm=size.crown_mm * wide,
        drive_mm=size.drive_mm * wide,
        drive_inner_mm=size.drive_inner_mm * wide,
        drive_depth_mm=size.drive_depth_mm * high,
    )


def build_bolt(spec: BoltSpec) -> BoltSolid:
    """Build a bolt, whether or not it is `missing`.

    Returns:
        Head, drive, washer and shank as one watertight body in frame `bolt`.

    Raises:
        ConfigError: The head would be no wider than its thread.
    """
    size = head_size(spec)
    head = _outer_head(spec, size)
    depth = size.drive_depth_mm * (1 - spec.clogged)
    if depth > 0.05:
        head -= _drive(spec.head, replace(size, drive_depth_mm=depth))
    head = head.rotate((0, 0, spec.roll_deg))
    washer = WASHERS[spec.thread_mm] if spec.washer else None
    height = size.height_mm + (washer.thickness_mm if washer else 0)
    radius = spec.thread_mm / 2
    bodies = [head, cylinder(radius, -height - spec.shank_mm, -size.height_mm + _OVERLAP_MM)]
    if size.drive_depth_mm > size.height_mm - _OVERLAP_MM - 0.05:
        bodies[1] = cylinder(radius, -height - spec.shank_mm, -size.height_mm)
    if washer:
        bodies.append(cylinder(washer.diameter_mm / 2, -height, -size.height_mm))
    return BoltSolid(
        body=union(bodies),
        across_mm=size.across_mm,
        head_diameter_mm=_head_diameter(spec, size),
        head_height_mm=height,
        shank_radius_mm=radius,
        shank_mm=spec.shank_mm,
    )


def split_bolt(solid: BoltSolid) -> tuple[Manifold, Manifold | None]:
    """Part a through-bolt into its head and the rod behind it.

    Class bolt means heads: what a screwdriver meets and what a bolt's position is measured at. A
    rod that runs along the yoke would stretch it over half the motor; the body that the bolt
    holds together owns it instead.

    Returns:
        Head, and rod from just below the seat on; a bolt shorter than `THROUGH_BOLT_MM` whole,
        and None. Both in frame `bolt`.
    """
    if solid.shank_mm < THROUGH_BOLT_MM:
        return solid.body, None
    cut_mm = -solid.head_height_mm - _NECK_MM
    head, rod = solid.body.split_by_plane((0.0, 0.0, 1.0), cut_mm)
    return head, rod


def rod_name(bolt_id: str) -> str:
    """Name of the solid that is a through-bolt's rod; only some bolts have one."""
    return f"main_housing_rod_{bolt_id}"


def bolt_clearance(spec: BoltSpec) -> Manifold:
    """Build what a bolt takes out of every other part, in frame `bolt`.

    That is the hole of its shank, and the head with some play from its seat up to a few mm over
    the head and over the rim of its counterbore.

    Raises:
        ConfigError: The head would be no wider than its thread.
    """
    size = head_size(spec)
    height = size.height_mm + (WASHERS[spec.thread_mm].thickness_mm if spec.washer else 0)
    head_radius = _head_diameter(spec, size) / 2 + _HEAD_PLAY_MM
    above = max(0.0, spec.recess_mm - height) + _ABOVE_MM
    hole = cylinder(spec.thread_mm / 2 + _HOLE_PLAY_MM, -height - spec.shank_mm - _BLIND_MM, 0)
    return hole + cylinder(head_radius, -height, above)


def _head_diameter(spec: BoltSpec, size: HeadSize) -> float:
    corners = 1.0
    if spec.head in (HeadKind.HEX, HeadKind.HEX_FLANGE):
        corners = 1 / math.cos(math.pi / 6)
    washer = WASHERS[spec.thread_mm].diameter_mm if spec.washer else 0.0
    return max(size.across_mm * corners, size.flange_mm, washer)


def _outer_head(spec: BoltSpec, size: HeadSize) -> Manifold:
    """A head without its recess, from z = -height_mm to 0."""
    match spec.head:
        case HeadKind.HEX:
            return _hexagon(size, spec.dish_mm)
        case HeadKind.HEX_FLANGE:
            return _hexagon(size, spec.dish_mm) + _flange(size)
        case HeadKind.SOCKET_CAP:
            return _edged(size, 0.06 * size.across_mm, draft_mm=0)
        case HeadKind.SLOTTED:
            return _edged(size, 0.05 * size.across_mm, draft_mm=0.09 * size.height_mm)
        case HeadKind.TORX_PAN | HeadKind.PHILLIPS_PAN:
            return _pan(size)


def _hexagon(size: HeadSize, dish_mm: float) -> Manifold:
    """A hexagon whose corners are turned off at the top, pressed in or flat."""
    flat = _CHAMFER_CIRCLE * size.across_mm / 2
    reach = size.across_mm
    slope = math.tan(math.radians(_CHAMFER_DEG))
    low = -size.height_mm
    fall = slope * (reach - flat)
    blank = prism(regular_polygon(6, size.across_mm), low, 0)
    # the cone goes on below the head so that it cuts the corners at the top alone
    cone = cylinder(reach, -fall, 0, top_radius_mm=flat)
    if fall < size.height_mm:
        # overlapping: faces that only touch may miss each other by a rounding error
        cone += cylinder(reach, low - 1, -fall + 0.05 * size.across_mm)
    head = blank ^ cone
    dish = min(dish_mm, 0.4 * size.height_mm)
    if dish > 0:
        head -= cylinder(0.5 * flat, -dish, 0, top_radius_mm=0.8 * flat) + cylinder(
            0.8 * flat, 0, 1
        )
    return head


def _flange(size: HeadSize) -> Manifold:
    """A flange with a rim and a conical top that ends under the hexagon's flats."""
    radius, low = size.flange_mm / 2, -size.height_mm
    edge = size.flange_edge_mm
    inner = 0.9 * size.across_mm / 2
    rise = min(math.tan(math.radians(25)) * (radius - inner), 0.6 * size.height_mm - edge)
    return turned(
        [(0, low), (radius, low), (radius, low + edge), (inner, low + edge + rise), (0, low + edge)]
    )


def _edged(size: HeadSize, edge_mm: float, *, draft_mm: float) -> Manifold:
    """A round head with a flat top, a rounded edge and a little draft."""
    radius, low = size.across_mm / 2, -size.height_mm
    top = radius - draft_mm
    angles = np.radians(np.linspace(0, 90, 4))
    arc = [
        (top - edge_mm * (1 - math.cos(a)), -edge_mm * (1 - math.sin(a))) for a in angles.tolist()
    ]
    return turned([(0, low), (radius, low), *arc, (0, 0)])


def _pan(size: HeadSize) -> Manifold:
    """A round head with a domed top and rounded shoulder; the rim of its recess is at z = 0."""
    radius, low = size.across_mm / 2, -size.height_mm
    crown = max(size.crown_mm, 1.02 * radius)
    mouth = min(0.52 * size.drive_mm, 0.8 * radius)
    angles = np.linspace(math.asin(0.97 * radius / crown), math.asin(mouth / crown), _CROWN_POINTS)
    top = crown * math.cos(float(angles[-1]))
    # a flat head keeps the height of the dome within it
    squeeze = min(1.0, 0.6 * size.height_mm / (top - crown * math.cos(float(angles[0]))))
    dome = [(crown * math.sin(a), squeeze * (crown * math.cos(a) - top)) for a in angles.tolist()]
    shoulder = dome[0][1] - 0.08 * radius
    return turned(
        [(0, low), (0.98 * radius, low), (radius, shoulder), *dome[:-1], (mouth, 0), (0, 0)]
    )


def _drive(kind: HeadKind, size: HeadSize) -> Manifold:
    """The recess of a head; empty for a hexagon."""
    depth, above = size.drive_depth_mm, 1.0
    match kind:
        case HeadKind.SOCKET_CAP:
            socket = prism(regular_polygon(6, size.drive_mm), -depth, above)
            tip = min(0.28 * size.drive_mm, 0.5 * (size.height_mm - depth))
            cone = cylinder(
                0.02 * size.drive_mm, -depth - tip, -depth, top_radius_mm=0.48 * size.drive_mm
            )
            # inside both: faces that only touch are not always merged, and a void would be left
            joint = cylinder(0.3 * size.drive_mm, -depth - 0.1 * tip, -depth + 0.01)
            return union([socket, cone, joint])
        case HeadKind.TORX_PAN:
            return prism(_six_lobes(size.drive_mm, size.drive_inner_mm), -depth, above)
        case HeadKind.PHILLIPS_PAN:
            wing = _tapered_wing(size.drive_mm, size.drive_inner_mm, depth, above)
            return wing + wing.rotate((0, 0, 90))
        case HeadKind.SLOTTED:
            return box(
                (3 * size.across_mm, size.drive_mm, depth + above), (0, 0, (above - depth) / 2)
            )
        case HeadKind.HEX | HeadKind.HEX_FLANGE:
            return Manifold()


def _six_lobes(outer_mm: float, inner_mm: float) -> FloatArray:
    """Outline of a hexalobular recess, shape (K, 2).

    Source:
        ISO 10664 joins twelve arcs; a cosine between the same two diameters is within 0.05 mm.
    """
    angles = 2 * math.pi * np.arange(_LOBE_POINTS) / _LOBE_POINTS
    radius = (outer_mm + inner_mm) / 4 + (outer_mm - inner_mm) / 4 * np.cos(6 * angles)
    return radius[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _tapered_wing(length_mm: float, width_mm: float, depth_mm: float, above_mm: float) -> Manifold:
    """One wing of a cross recess: straight above, narrowing to the bottom."""
    top = box((length_mm, width_mm, above_mm), (0, 0, above_mm / 2))
    bottom = box((0.4 * length_mm, 0.6 * width_mm, 0.02), (0, 0, -depth_mm + 0.01))
    return hull([top, bottom])
