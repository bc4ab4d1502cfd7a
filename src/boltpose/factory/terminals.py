"""Everything electrical outside: studs with nuts and washers, plugs, the cable into the motor."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray
from boltpose.factory.cables import build_cable, lug_thickness_mm
from boltpose.factory.distractors import hexagon_nut
from boltpose.factory.head_sizes import NUTS
from boltpose.factory.layout import Layout
from boltpose.factory.model import Material, SolidPart
from boltpose.factory.solids import (
    Manifold,
    box,
    cylinder,
    hull,
    polar,
    solid_part,
    turned,
    union,
)
from boltpose.factory.spec import MotorSpec, PlugSpec, StudSpec
from boltpose.schema import Part

_FOOT_MM = 2.0
"""Height of the insulating foot of a stud."""
_WASHER_MM = 1.0
_GAP_MM = 0.05
"""Between what lies on each other: faces in one plane leave crumbs when one is cut by the other."""
_PITCH_MM = {5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5}
_WALL_MM = 1.4
_BLADE_MM = (6.3, 0.8)
_CRUMB_MM3 = 1.0
_Piece = tuple[str, Manifold, Material]
"""Name after the class, body, material."""
_TURNED_OVER = np.diag([1.0, -1.0, -1.0])
"""z looks along -z of frame `build`."""


def build_terminals(spec: MotorSpec, layout: Layout) -> list[SolidPart]:
    """Build studs, plug and cable of a motor.

    They stand on the back of the solenoid's cap, without a solenoid on the back of the rear cap.
    A stud too short for its nuts is made as long as they need.

    Returns:
        Watertight parts of class electrical connector in frame `build`; feet go on below the
        surface, so that they also meet domed and stepped caps.
    """
    terminals = spec.terminals
    face_z = layout.terminal_z(spec)
    cap = spec.rear_cap.length_mm if spec.solenoid is None else spec.solenoid.cap_length_mm
    centre = np.array([*layout.terminal_xy, face_z])
    studs: list[_Piece] = []
    feet: list[_Piece] = []
    cable: list[_Piece] = []
    for number, stud in enumerate(terminals.studs, start=1):
        has_lug = terminals.cable is not None and terminals.cable.stud == number - 1
        build_from_stud = _stud_pose(stud, centre)
        metal, lug_z = _stud(stud, has_lug=has_lug)
        studs.append(
            (
                f"stud_{number}",
                metal.transform(build_from_stud),
                Material.COPPER if stud.thread_mm >= 8 else Material.ZINC,
            )
        )
        foot = cylinder(1.05 * stud.thread_mm, -0.5 * cap, _FOOT_MM)
        upright = np.column_stack([_TURNED_OVER, build_from_stud[:, 3]])
        feet.append((f"foot_{number}", foot.transform(upright), Material.BLACK_PLASTIC))
        if has_lug and terminals.cable is not None:
            lug_at = build_from_stud @ np.array([0, 0, lug_z, 1])
            cable = build_cable(terminals.cable, lug_at, stud.thread_mm, spec, layout)
    plug = [] if terminals.plug is None else _plug_pieces(terminals.plug, spec, layout, 0.5 * cap)
    return _disjoint([*studs, *cable, *feet, *plug])


def _disjoint(pieces: list[_Piece]) -> list[SolidPart]:
    """Make parts of overlapping pieces; what comes first keeps its room."""
    parts: list[SolidPart] = []
    taken: list[Manifold] = []
    for name, body, material in pieces:
        shape = body - union([other for other in taken if boxes_touch(other, body)])
        solid = [piece for piece in shape.decompose() if piece.volume() > _CRUMB_MM3]
        if not solid:
            continue
        shape = Manifold.compose(solid)
        taken.append(shape)
        name = f"electrical_connector_{name}"
        parts.append(solid_part(shape, name, Part.ELECTRICAL_CONNECTOR, material))
    return parts


def boxes_touch(first: Manifold, second: Manifold) -> bool:
    """Whether the boxes around two bodies meet."""
    a, b = np.asarray(first.bounding_box()), np.asarray(second.bounding_box())
    return bool((a[:3] < b[3:]).all() and (b[:3] < a[3:]).all())


def _stud_pose(stud: StudSpec, centre: FloatArray) -> FloatArray:
    """`build_from_stud`, shape (3, 4): z away from the cap, leaning outwards by the bend."""
    x, y = polar(stud.radius_mm, stud.angle_deg)
    origin = centre + (x, y, 0)
    # leans to its outside, which is where it is hit
    angle = math.radians(stud.angle_deg)
    axis = np.array([-math.sin(angle), math.cos(angle), 0])
    lean = Rotation.from_rotvec(-math.radians(stud.bend_deg) * axis).as_matrix()
    return np.column_stack([lean @ _TURNED_OVER, origin])


def _stud(stud: StudSpec, *, has_lug: bool) -> tuple[Manifold, float]:
    """Threaded rod with nuts and washers in frame `stud`, and where a lug lies on it."""
    thread = stud.thread_mm
    across = NUTS[thread].across_mm
    nut = hexagon_nut(across, stud.nut_height_mm).rotate((0, 0, 17 + 40 * stud.nuts))
    washer = cylinder(thread, 0, _WASHER_MM)
    bodies: list[Manifold] = []
    z = _FOOT_MM + _GAP_MM
    if stud.nuts == 2:
        bodies.append(nut.translate((0, 0, z)))
        z += stud.nut_height_mm
    lug_z = z
    if has_lug:
        z += lug_thickness_mm() + _GAP_MM
    if stud.nuts >= 1:
        bodies.append(washer.translate((0, 0, z)))
        z += _WASHER_MM
        bodies.append(nut.rotate((0, 0, 23)).translate((0, 0, z)))
        z += stud.nut_height_mm
    length = max(stud.length_mm, z + 1)
    bodies.append(_threaded_rod(thread / 2, _PITCH_MM[thread], length))
    return union(bodies), lug_z


def _threaded_rod(radius_mm: float, pitch_mm: float, length_mm: float) -> Manifold:
    """A rod with ring grooves in place of a thread, from z = 0."""
    depth = 0.5 * pitch_mm
    profile: list[tuple[float, float]] = [(0, 0), (radius_mm, 0), (radius_mm, 1)]
    z = 1.0
    while z + pitch_mm < length_mm - depth:
        profile += [(radius_mm - depth, z + 0.5 * pitch_mm), (radius_mm, z + pitch_mm)]
        z += pitch_mm
    profile += [(radius_mm, length_mm - depth), (radius_mm - depth, length_mm), (0, length_mm)]
    return turned(profile)


def _plug_pieces(plug: PlugSpec, spec: MotorSpec, layout: Layout, sink_mm: float) -> list[_Piece]:
    angle = math.radians(plug.angle_deg)
    radial = np.array([math.cos(angle), math.sin(angle), 0])
    tangent = np.array([-math.sin(angle), math.cos(angle), 0])
    back = np.array([0.0, 0.0, -1.0])
    centre = np.array([*layout.terminal_xy, layout.terminal_z(spec)])
    if plug.on_side:
        mantle = layout.cap_radius_mm if spec.solenoid is None else layout.solenoid_cap_radius_mm
        origin = centre + mantle * radial - sink_mm * back
        sink_mm = 0.4 * mantle
        axes = np.column_stack([tangent, -back, radial])
    else:
        origin = centre + plug.radius_mm * radial
        axes = np.column_stack([-tangent, radial, back])
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    build_from_plug = np.column_stack([axes, origin])
    return [
        (name, body.transform(build_from_plug), material)
        for name, body, material in _plug(plug, sink_mm)
    ]


def _plug(plug: PlugSpec, sink_mm: float) -> list[_Piece]:
    """Housing and contacts in frame `plug`: z out of the surface, x along the width."""
    width, depth, height = plug.size_mm
    match plug.kind:
        case "box":
            shell = _rounded(width, depth, -sink_mm, height) + _rounded(
                width + 3, depth + 3, -sink_mm, 0.18 * height
            )
            floor = 0.4 * height
            shell -= _rounded(width - 2 * _WALL_MM, depth - 2 * _WALL_MM, floor, height + 1)
            latch = box((0.35 * width, 1.6, 2.4), (0, depth / 2 + 0.6, 0.75 * height))
            pins = [
                box((0.8, min(2.8, 0.4 * depth), 0.35 * height + 1), (x, 0, floor + 0.17 * height))
                for x in (-0.18 * width, 0.18 * width)
            ]
            return [
                ("plug", shell + latch, Material.BLACK_PLASTIC),
                ("plug_contacts", union(pins), Material.ZINC),
            ]
        case "blade":
            foot = _rounded(width, depth, -sink_mm, 0.35 * height)
            wide = min(_BLADE_MM[0], 0.8 * width)
            blade = box((wide, _BLADE_MM[1], 0.8 * height), (0, 0, 0.6 * height))
            tip = _blade_limit(wide, height)
            return [
                ("plug", foot, Material.BLACK_PLASTIC),
                ("plug_contacts", blade ^ tip, Material.ZINC),
            ]
        case "round":
            outer = min(width, depth) / 2
            wall = min(_WALL_MM, 0.3 * outer)
            profile = [
                (0, -sink_mm),
                (1.15 * outer, -sink_mm),
                (1.15 * outer, 0.15 * height),
                (outer, 0.22 * height),
                (outer, height - 0.5),
                (outer - 0.5, height),
                (outer - wall, height),
                (outer - wall, 0.4 * height),
                (0, 0.4 * height),
            ]
            key = box((0.3 * outer, 1.5, 0.6 * height), (0, outer + 0.4, 0.55 * height))
            pin = cylinder(0.22 * outer, 0.35 * height, 0.85 * height)
            return [
                ("plug", turned(profile) + key, Material.BLACK_PLASTIC),
                ("plug_contacts", pin, Material.ZINC),
            ]


def _rounded(width_mm: float, depth_mm: float, z_low_mm: float, z_high_mm: float) -> Manifold:
    """A block with rounded vertical edges."""
    radius = min(1.5, 0.25 * width_mm, 0.25 * depth_mm)
    x, y = width_mm / 2 - radius, depth_mm / 2 - radius
    post = cylinder(radius, z_low_mm, z_high_mm)
    return hull([post.translate((i * x, j * y, 0)) for i in (-1, 1) for j in (-1, 1)])


def _blade_limit(width_mm: float, height_mm: float) -> Manifold:
    """What a blade contact is cut with, so that its tip is narrower."""
    low = box((width_mm + 1, 4, 0.9 * height_mm + 40), (0, 0, 0.45 * height_mm - 20))
    tip = box((0.6 * width_mm, 4, 0.02), (0, 0, height_mm))
    return hull([low, tip])
