"""The cap behind the yoke: flat, domed, stepped or with openings. Frame `build`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from boltpose.factory.castings import bar, disc, joined, plate, turned_eased
from boltpose.factory.layout import CAP_STEP, Layout, cap_back_z
from boltpose.factory.model import Material
from boltpose.factory.pieces import Piece
from boltpose.factory.ribs import gusset
from boltpose.factory.sites import Body, Lug, lug_bodies
from boltpose.factory.solids import Manifold, cylinder, polar, union
from boltpose.factory.spec import MotorSpec
from boltpose.schema import Part

_RIB_MM = 3.0


def build_rear_cap(spec: MotorSpec, layout: Layout, lugs: Sequence[Lug]) -> list[Piece]:
    """Shape the rear cap with its bearing cup."""
    cap = spec.rear_cap
    body = _spider(spec, layout) if cap.style == "spider" else _turned_cap(spec, layout)
    body += union([*lug_bodies(lugs, Body.REAR_CAP), *_ribs(spec, layout), _hub(spec, layout)])
    if cap.hub_hollow:
        bore = 0.55 * cap.hub_radius_mm
        floor = layout.cap_rear_z + 0.6 * cap.length_mm
        body -= cylinder(bore, layout.hub_rear_z - 1, floor)
        body += cylinder(0.62 * bore, layout.hub_rear_z + 1.5, floor + 0.5)
    # nothing of the cap goes over the joint
    body = body.trim_by_plane((0, 0, -1), -layout.yoke_rear_z)
    return [
        Piece(
            name="main_housing_rear_cap",
            part=Part.MAIN_HOUSING,
            material=Material(cap.finish),
            shape=body,
            body=Body.REAR_CAP,
        )
    ]


def _turned_cap(spec: MotorSpec, layout: Layout) -> Manifold:
    cap, radius = spec.rear_cap, layout.cap_radius_mm
    edge = min(cap.edge_mm, 0.45 * cap.length_mm)
    if cap.style == "domed":
        shares = np.linspace(0, 1, 9).tolist()
        back = [(share * radius, cap_back_z(spec, layout, share * radius), 0.0) for share in shares]
        back[-1] = (*back[-1][:2], edge)
    elif cap.style == "stepped":
        inner, outer = CAP_STEP[0] * radius, CAP_STEP[1] * radius
        low = cap_back_z(spec, layout, outer)
        back = [
            (0.0, layout.cap_rear_z, 0.0),
            (inner, layout.cap_rear_z, edge),
            (outer, low, 1.5),
            (radius, low, edge),
        ]
    else:
        back = [(0.0, layout.cap_rear_z, 0.0), (radius, layout.cap_rear_z, edge)]
    front = [(radius, layout.yoke_rear_z, 0.4), (0.0, layout.yoke_rear_z, 0.0)]
    return turned_eased([*back, *front])


def _spider(spec: MotorSpec, layout: Layout) -> Manifold:
    """A ring, arms and a hub."""
    cap, radius = spec.rear_cap, layout.cap_radius_mm
    ring = disc(radius) - disc(radius - max(3.5, 0.12 * radius))
    arms = [
        bar((0, 0), 0.16 * radius, polar(0.9 * radius, 360 * index / cap.openings), 0.1 * radius)
        for index in range(cap.openings)
    ]
    outline = joined([ring, disc(1.15 * cap.hub_radius_mm), *arms], fillet_mm=2.5)
    return plate(outline, layout.cap_rear_z, layout.yoke_rear_z, round_low_mm=min(cap.edge_mm, 1.5))


def _hub(spec: MotorSpec, layout: Layout) -> Manifold:
    cap = spec.rear_cap
    if cap.hub_height_mm <= 0:
        return Manifold()
    radius, foot = cap.hub_radius_mm, layout.cap_rear_z + 0.6 * cap.length_mm
    flare = min(2.0, 0.4 * cap.hub_height_mm)
    return turned_eased(
        [
            (0, layout.hub_rear_z, 0),
            (radius, layout.hub_rear_z, min(1.5, 0.4 * cap.hub_height_mm)),
            (radius, layout.cap_rear_z, flare),
            (radius + flare + 0.5, layout.cap_rear_z, 0),
            (radius + flare + 0.5, foot, 0),
            (0, foot, 0),
        ]
    )


def _ribs(spec: MotorSpec, layout: Layout) -> list[Manifold]:
    cap, radius = spec.rear_cap, layout.cap_radius_mm
    if cap.ribs == 0 or cap.style == "spider":
        return []
    top = layout.cap_rear_z - (0.5 * min(cap.hub_height_mm, 5.0) if cap.style == "flat" else 0.3)
    inner, outer = 0.4 * cap.hub_radius_mm, 0.93 * radius
    front, rim = layout.yoke_rear_z - 0.5, cap_back_z(spec, layout, radius) - 1.0
    shape = [(inner, top), (outer, max(top, rim)), (outer, front), (inner, front)]
    if cap.style == "stepped":  # the rib bridges the step
        shape.insert(1, (CAP_STEP[0] * radius, top))
    return [
        gusset(360 * (index + 0.5) / cap.ribs, (0, 0), shape, _RIB_MM) for index in range(cap.ribs)
    ]
