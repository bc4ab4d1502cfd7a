"""The yoke: a steel tube with grooves, bands, flats, crimps and a name plate. Frame `build`."""

from __future__ import annotations

from collections.abc import Sequence

from boltpose.factory.castings import turned_eased, wedge
from boltpose.factory.layout import Layout
from boltpose.factory.model import Material
from boltpose.factory.pieces import Piece
from boltpose.factory.sites import Body, Lug, lug_bodies
from boltpose.factory.solids import Manifold, box, cylinder, hull, polar, tube, union
from boltpose.factory.spec import HousingSpec, MotorSpec
from boltpose.schema import Part

_GROOVE_MM = (2.4, 0.9)
"""Width and depth of a groove."""
_BAND_MM = (7.0, 1.1)
"""Width and height of a raised band."""
_WALL_MM = 4.5
_OPEN_DEPTH = 0.35
"""How deep one sees into the yoke through an open rear cap, in its lengths."""
_PLATE_MM = 0.6


def build_yoke(spec: MotorSpec, layout: Layout, lugs: Sequence[Lug]) -> list[Piece]:
    """Shape the yoke and its name plate."""
    housing = spec.housing
    rear, radius = layout.yoke_rear_z, housing.radius_mm
    tube_body = _mantle(housing, rear)
    cuts = [_flat(housing, angle) for angle in housing.flats]
    cuts += [_crimp(housing, rear, index) for index in range(housing.crimps)]
    if spec.rear_cap.style == "spider":
        cuts.append(cylinder(radius - _WALL_MM, rear - 1, rear + _OPEN_DEPTH * housing.length_mm))
    if housing.seam_angle_deg is not None:
        x, y = polar(radius - 0.6, housing.seam_angle_deg)
        tube_body += cylinder(1.5, rear + 0.5, -0.5).translate((x, y, 0))
    body = _oval(housing, tube_body - union(cuts))
    if spec.rear_cap.style == "spider":
        body += _armature(spec, rear)
    body += union(lug_bodies(lugs, Body.YOKE))
    material = Material(housing.finish)
    pieces = [
        Piece(
            name="main_housing_yoke",
            part=Part.MAIN_HOUSING,
            material=material,
            shape=body,
            body=Body.YOKE,
        )
    ]
    if housing.name_plate_angle_deg is not None:
        pieces.append(
            Piece(
                name="main_housing_name_plate",
                part=Part.MAIN_HOUSING,
                material=Material.BARE_STEEL,
                shape=_oval(housing, _name_plate(housing, housing.name_plate_angle_deg)),
            )
        )
    return pieces


def _mantle(housing: HousingSpec, rear_z: float) -> Manifold:
    """The tube with what runs around it, as one profile."""
    radius = housing.radius_mm
    steps = [(place, _GROOVE_MM[0], radius - _GROOVE_MM[1]) for place in housing.grooves]
    steps += [(place, _BAND_MM[0], radius + _BAND_MM[1]) for place in housing.bands]
    profile = [(0.0, rear_z, 0.0), (radius, rear_z, 1.0)]
    last = rear_z + 2
    for place, width, level in sorted(steps, reverse=True):
        low, high = -place - width / 2, -place + width / 2
        if low < last or high > -2:
            continue  # it would run over an end or its neighbour
        profile += [(radius, low, 0.3), (level, low, 0.4), (level, high, 0.4), (radius, high, 0.3)]
        last = high + 0.5
    profile += [(radius, 0.0, 0.6), (0.0, 0.0, 0.0)]
    return turned_eased(profile)


def _oval(housing: HousingSpec, body: Manifold) -> Manifold:
    share = 0.5 * housing.ovality_mm / housing.radius_mm
    return body if share <= 0 else body.scale((1 + share, 1 - share, 1))


def _flat(housing: HousingSpec, angle_deg: float) -> Manifold:
    length, depth = 0.72 * housing.length_mm, housing.flat_depth_mm
    block = box(
        (20, 2 * housing.radius_mm, length),
        (housing.radius_mm - depth + 10, 0, -0.5 * housing.length_mm),
    )
    return block.rotate((0, 0, angle_deg))


def _crimp(housing: HousingSpec, rear_z: float, index: int) -> Manifold:
    """A dent, longer around than along, as a punch leaves it."""
    angle = 360 * index / housing.crimps + 180 / housing.crimps
    ball = Manifold.sphere(4.0, 24)
    dent = hull([ball.translate((0, -3, 0)), ball.translate((0, 3, 0))])
    return dent.translate((housing.radius_mm + 2.4, 0, rear_z + 5.5)).rotate((0, 0, angle))


def _armature(spec: MotorSpec, rear_z: float) -> Manifold:
    """Commutator, brush holders and shaft, as seen through an open rear cap."""
    radius, depth = spec.housing.radius_mm, _OPEN_DEPTH * spec.housing.length_mm
    commutator = cylinder(0.42 * radius, rear_z + 3, rear_z + depth + 1)
    shaft = cylinder(0.14 * radius, rear_z - 0.2 * spec.rear_cap.length_mm, rear_z + depth)
    brushes = [
        box(
            (0.34 * radius, 0.24 * radius, 0.6 * depth), (0.6 * radius, 0, rear_z + 0.7 * depth)
        ).rotate((0, 0, 45 + 90 * index))
        for index in range(4)
    ]
    return union([commutator, shaft, *brushes])


def _name_plate(housing: HousingSpec, angle_deg: float) -> Manifold:
    """A thin bent plate with four rivets."""
    along, around = housing.name_plate_size_mm
    along = min(along, 0.7 * housing.length_mm)
    radius = housing.radius_mm
    width = min(57.3 * around / radius, 120.0)
    middle = -0.5 * housing.length_mm
    sector = (
        wedge(2 * radius, angle_deg, width).extrude(along).translate((0, 0, middle - along / 2))
    )
    sheet = tube(radius + _PLATE_MM, radius - 0.8, middle - along, middle + along) ^ sector
    rivets = []
    for side in (-1, 1):
        x, y = polar(radius, angle_deg + side * (0.5 * width - 57.3 * 3 / radius))
        for end in (-1, 1):
            z = middle + end * (along / 2 - 3)
            rivet = Manifold.sphere(1.6, 16).translate((x, y, z))
            rivets.append(rivet)
    return union([sheet, *rivets])
