"""The ring of a reduction gear between yoke and bracket. Frame `build`."""

from __future__ import annotations

from collections.abc import Sequence

from boltpose.factory.castings import CrossSection, disc, joined, plate
from boltpose.factory.layout import Layout
from boltpose.factory.model import Material
from boltpose.factory.pieces import Piece
from boltpose.factory.sites import Body, Lug, lug_bodies
from boltpose.factory.solids import Manifold, box, union
from boltpose.factory.spec import GearboxSpec, MotorSpec
from boltpose.schema import Part

_RIB_MM = (4.0, 2.2)
"""Width and height of a rib."""


def build_gearbox(spec: MotorSpec, layout: Layout, lugs: Sequence[Lug]) -> list[Piece]:
    """Shape the gearbox ring; nothing for a direct drive."""
    gearbox = spec.gearbox
    if gearbox is None:
        return []
    front = layout.bracket_rear_z
    shapes = [
        plate(gearbox_outline(spec, layout), 0, front, round_low_mm=1.2, round_high_mm=0.5),
        *_ribs(gearbox),
        *lug_bodies(lugs, Body.GEARBOX),
    ]
    if gearbox.flange_mm > 0:
        wide = gearbox_outline(spec, layout).offset(gearbox.flange_mm)
        shapes.append(
            plate(wide, front - min(5.0, 0.3 * gearbox.length_mm), front, round_low_mm=1.0)
        )
    body = union(shapes).trim_by_plane((0, 0, 1), 0).trim_by_plane((0, 0, -1), -front)
    return [
        Piece(
            name="connector_gearbox",
            part=Part.CONNECTOR,
            material=Material(gearbox.finish),
            shape=body,
            body=Body.GEARBOX,
        )
    ]


def gearbox_outline(spec: MotorSpec, layout: Layout) -> CrossSection:
    """Outline at the joint to the bracket: round, or around both axes of an offset gear."""
    gearbox = spec.gearbox
    if gearbox is None:
        return disc(spec.housing.radius_mm)
    main = disc(gearbox.radius_mm)
    if gearbox.shaft_offset_mm <= 0:
        return main
    beside = disc(spec.bracket.radius_mm, layout.shaft_xy)
    # a waist keeps the two wheels' rooms apart, as castings of offset gears have it
    core = CrossSection.batch_hull(
        [disc(0.8 * gearbox.radius_mm), disc(0.8 * spec.bracket.radius_mm, layout.shaft_xy)]
    )
    return joined([main, beside, core], fillet_mm=8)


def _ribs(gearbox: GearboxSpec) -> list[Manifold]:
    width, height = _RIB_MM
    block = box(
        (height + 3, width, gearbox.length_mm - 3),
        (gearbox.radius_mm + 0.5 * (height - 3), 0, 0.5 * gearbox.length_mm),
    )
    return [block.rotate((0, 0, 360 * index / gearbox.ribs)) for index in range(gearbox.ribs)]
