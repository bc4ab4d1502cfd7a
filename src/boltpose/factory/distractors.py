"""What looks like a bolt and is none: nuts, rivets, bosses, pole screws, empty holes, dowels.

Frame `seat`: origin on the surface, +z out of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boltpose.factory.solids import (
    Manifold,
    box,
    cylinder,
    prism,
    regular_polygon,
    turned,
)
from boltpose.factory.spec_fasteners import DistractorKind, DistractorSpec

_SINK_MM = 2.5
"""How far below the seat a body starts, so that it meets curved surfaces all around."""
_MIN_HEIGHT_MM = 0.4
_SCREW_GAP_MM = 0.2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DistractorSolid:
    """Changes to the body that it sits on: first cut, then add. Frame `seat`."""

    add: Manifold | None
    cut: Manifold | None


def build_distractor(spec: DistractorSpec) -> DistractorSolid:
    """Build something that looks like a bolt."""
    radius = spec.size_mm / 2
    height = max(spec.height_mm, _MIN_HEIGHT_MM)
    match spec.kind:
        case DistractorKind.NUT:
            stud = cylinder(0.3 * spec.size_mm, -_SINK_MM, 1.3 * height)
            nut = hexagon_nut(spec.size_mm, height)
            base = prism(regular_polygon(6, 0.9 * spec.size_mm), -_SINK_MM, 0.1)
            return DistractorSolid(add=nut + stud + base, cut=None)
        case DistractorKind.RIVET:
            return DistractorSolid(add=_dome(radius, min(height, radius)), cut=None)
        case DistractorKind.BOSS:
            edge = min(0.12 * radius, 0.5 * height)
            foot = radius + 0.08 * height
            profile = [
                (0, -_SINK_MM),
                (foot, -_SINK_MM),
                (foot, 0),
                (radius, height - edge),
                (radius - edge, height),
                (0, height),
            ]
            return DistractorSolid(add=turned(profile), cut=None)
        case DistractorKind.POLE_SCREW:
            return _pole_screw(radius, min(spec.height_mm, 1.0))
        case DistractorKind.HOLE:
            depth = max(spec.height_mm, 1.0)
            edge = min(0.15 * radius, 0.5)
            cut = cylinder(radius, -depth, 3) + cylinder(
                radius, -edge, 0.01, top_radius_mm=radius + edge
            )
            return DistractorSolid(add=None, cut=cut)
        case DistractorKind.DOWEL:
            edge = min(0.2 * radius, 0.4 * height)
            pin = turned(
                [
                    (0, -_SINK_MM),
                    (radius, -_SINK_MM),
                    (radius, height - edge),
                    (radius - edge, height),
                    (0, height),
                ]
            )
            if spec.size_mm >= 5:  # larger ones are dowel sleeves
                pin -= cylinder(0.62 * radius, height - 0.9 * height - 1, height + 1)
            return DistractorSolid(add=pin, cut=None)


def hexagon_nut(across_mm: float, height_mm: float) -> Manifold:
    """A nut, corners turned off at both ends, without its bore; from z = 0 to height_mm."""
    flat, reach = 0.95 * across_mm / 2, 0.62 * across_mm
    fall = min(math.tan(math.radians(30)) * (reach - flat), 0.45 * height_mm)
    corners = turned(
        [
            (0, 0),
            (flat, 0),
            (reach, fall),
            (reach, height_mm - fall),
            (flat, height_mm),
            (0, height_mm),
        ]
    )
    return prism(regular_polygon(6, across_mm), 0, height_mm) ^ corners


def _dome(radius_mm: float, height_mm: float) -> Manifold:
    """A spherical cap that goes on below the surface."""
    sphere = (radius_mm**2 + height_mm**2) / (2 * height_mm)
    last = math.asin(min(1.0, radius_mm / sphere))
    arc = [
        (sphere * math.sin(a), height_mm - sphere * (1 - math.cos(a)))
        for a in np.linspace(last, 0, 7).tolist()
    ]
    return turned([(0, -_SINK_MM), (radius_mm, -_SINK_MM), *arc[:-1], (0, height_mm)])


def _pole_screw(radius_mm: float, proud_mm: float) -> DistractorSolid:
    """A countersunk screw with a slot, sunk into its cone."""
    depth, rim, top = 0.8 * radius_mm, 0.3 * radius_mm, proud_mm - 0.1 * radius_mm
    wide = radius_mm + _SCREW_GAP_MM
    cut = turned([(0, -depth), (0.55 * radius_mm, -depth), (wide, -rim), (wide, 4), (0, 4)])
    stem = 0.45 * radius_mm
    head = turned(
        [
            (0, -depth - 1),
            (stem, -depth - 1),
            (stem, -depth),
            (radius_mm, -rim),
            (radius_mm, top),
            (0, top),
        ]
    )
    slot = box((3 * radius_mm, 0.3 * radius_mm, 4), (0, 0, top - 0.35 * radius_mm + 2))
    return DistractorSolid(add=head - slot, cut=cut)
