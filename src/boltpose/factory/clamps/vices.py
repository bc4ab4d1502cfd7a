"""Vices: a parallel vice with flat jaws, and a self-centring vice with prismatic jaws."""

from __future__ import annotations

import math

import numpy as np

from boltpose.factory.clamps.assembly import (
    PRESS_MM,
    Assembly,
    ClampBody,
    InfeasibleError,
    table_pose,
)
from boltpose.factory.clamps.fasteners import (
    bevelled_box,
    chamfered_hexagon,
    hex_screw,
    socket_screw,
    thumb_bar,
)
from boltpose.factory.clamps.workpiece import Workpiece
from boltpose.factory.model import Material
from boltpose.factory.solids import Manifold, box, cylinder, prism, union
from boltpose.geometry.transforms import Transform

_SERRATION_MM = 2.4


def _grip(
    rng: np.random.Generator, work: Workpiece, width_mm: float, half_width_deg: float
) -> tuple[float, float]:
    """Where along the yoke the jaws grip (z of their middle), and which side looks to +y."""
    low, high = work.yoke_low_mm + 1, work.yoke_high_mm - 1
    reach = min(width_mm, high - low)
    middle = 0.5 * (low + high) + float(rng.uniform(-0.5, 0.5)) * (high - low - reach)
    slab = (middle - reach / 2, middle + reach / 2)
    return middle, work.pick_bare_angle(rng, [slab], half_width_deg, opposite=True)


def _hang(
    rng: np.random.Generator,
    work: Workpiece,
    grip_mm: float,
    side_deg: float,
    slope_deg: float,
    height_mm: float,
) -> Transform:
    """The pose of a motor between jaws that close along y; the gripped middle is over x = 0.

    Its axis lies in the xz-plane at `slope_deg` from x. Of its two ways round the one is taken
    that has the solenoid higher.
    """
    slope = math.radians(slope_deg)
    sign = 1.0 if rng.random() < 0.5 else -1.0
    axis = np.array([sign * math.cos(slope), 0, math.sin(slope)])
    poses = [
        table_pose(axis, (0, side, 0), side_deg, (0, 0, height_mm) - grip_mm * axis)
        for side in (1.0, -1.0)
    ]
    # y of frame `motor` points to the solenoid
    return max(poses, key=lambda pose: float(pose.rotation[2, 1]))


def _serrated(rng: np.random.Generator, size: tuple[float, float, float]) -> Manifold:
    """A jaw plate whose face looks to +y from y = 0, with teeth along x or crosswise."""
    wide, thick, tall = size
    plate = box(size, (0, -thick / 2, 0))
    style = int(rng.integers(3))
    if style == 0:
        return plate
    half = 0.5 * _SERRATION_MM
    groove = prism([(-half * 0.8, 0.3), (0, -half * 0.7), (half * 0.8, 0.3)], -wide, wide)
    along_x = groove.rotate((0, 90, 0))  # lies along x, open to +y
    rows = np.arange(-tall / 2 + _SERRATION_MM, tall / 2, _SERRATION_MM)
    grooves = [along_x.translate((0, 0, float(z))) for z in rows]
    if style == 2:
        columns = np.arange(-wide / 2 + _SERRATION_MM, wide / 2, 2 * _SERRATION_MM)
        grooves += [groove.translate((float(x), 0, 0)) for x in columns]
    return plate - union(grooves)


def build_parallel_vice(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A machine vice: fixed and moving jaw, guides, screw with handle; the motor at any slope."""
    width = float(rng.uniform(0.8, 1.3)) * min(work.yoke_length_mm, 110)
    if width < 25:
        raise InfeasibleError("yoke too short for a vice")
    grip, side = _grip(rng, work, width, 16)
    slope = float(rng.choice([0.0, 90.0, rng.uniform(0, 90)]))
    # a standing motor shows its side to the jaws' width, not its length
    below_top = float(rng.uniform(4, 16))
    flat = _hang(rng, work, grip, side, slope, 0.0)
    posed = work.posed(flat)
    bed = float(rng.uniform(18, 30))
    low = posed.within((1, -work.radius_mm, work.radius_mm))
    needed = -posed.support_any((0, 0, -1), low)
    depth = min(max(work.radius_mm * 0.4, 12), 40)
    axis_height = bed + max(-needed + 2, depth) + float(rng.uniform(0, 8))
    top = axis_height + below_top
    jaw_tall = top - bed
    if jaw_tall > 150:
        raise InfeasibleError("the motor would hang too high in the vice")
    pose = Transform.from_parts(
        "table", "motor", flat.rotation, flat.translation_mm + (0, 0, axis_height)
    )
    posed = work.posed(pose)
    plate_tall = min(jaw_tall - 2, depth + below_top + float(rng.uniform(0, 10)))
    region = posed.within((0, -width / 2, width / 2), (2, top - plate_tall, top))
    right, left = posed.support((0, 1, 0), region), -posed.support((0, -1, 0), region)
    jaw_thick = float(rng.uniform(22, 40))
    plate_thick = float(rng.uniform(6, 11))
    cast = Material.CAST_IRON if rng.random() < 0.5 else Material.PAINTED_STEEL
    template = _serrated(rng, (width, plate_thick, plate_tall))
    plate_z = top - plate_tall / 2
    fixed_plate = template.translate((0, left + PRESS_MM, plate_z))
    moving_plate = template.rotate((0, 0, 180)).translate((0, right - PRESS_MM, plate_z))
    pieces = [
        ClampBody(name="fixed_plate", body=fixed_plate, material=Material.BARE_STEEL),
        ClampBody(name="moving_plate", body=moving_plate, material=Material.BARE_STEEL),
    ]
    jaw_width = width + float(rng.uniform(0, 10))
    fixed_face, moving_face = left + PRESS_MM - plate_thick, right - PRESS_MM + plate_thick
    long_back = float(rng.uniform(35, 80))
    y_low = fixed_face - jaw_thick
    y_high = moving_face + jaw_thick + long_back
    fixed = bevelled_box(
        (jaw_width, jaw_thick, top - 0.5), 2, (0, fixed_face - jaw_thick / 2, top / 2)
    )
    moving = bevelled_box(
        (jaw_width, jaw_thick, jaw_tall - 0.5), 2,
        (0, moving_face + jaw_thick / 2, bed + jaw_tall / 2),
    )  # fmt: skip
    foot = bevelled_box(
        (jaw_width * 0.9, y_high - y_low, bed), 2, (0, 0.5 * (y_low + y_high), bed / 2)
    )
    slot = box((jaw_width * 0.3, y_high - fixed_face - 26, bed), (0, 0, 0)).translate(
        (0, 0.5 * (fixed_face + 10 + y_high - 16), bed * 0.75)
    )
    lugs: list[Manifold] = []
    screws: list[Manifold] = []
    size = int(rng.choice([8, 10, 12]))
    for sx in (-1, 1):
        for y in (y_low + jaw_thick / 2, y_high - 20):
            x = sx * (jaw_width * 0.45 + 12)
            lugs.append(bevelled_box((32, 28, 12), 1, (x, y, 6)))
            screws.append(hex_screw(size).translate((x + sx * 3, y, 12)))
    pieces.append(
        ClampBody(name="vice_body", body=union([fixed, foot - slot, *lugs]), material=cast)
    )
    pieces.append(ClampBody(name="vice_jaw", body=moving, material=cast))
    nut_block = bevelled_box((jaw_width * 0.55, 20, bed + 14), 2, (0, y_high - 10, (bed + 14) / 2))
    spindle = cylinder(7, moving_face + jaw_thick - 4, y_high + 26).rotate((-90, 0, 0))
    spindle_z = bed + 2
    hub = cylinder(11, y_high + 12, y_high + 30).rotate((-90, 0, 0))
    bar = thumb_bar(float(rng.uniform(80, 130)), 4.5).rotate((0, float(rng.uniform(0, 180)), 0))
    # the handle turns clear of the table
    if rng.random() < 0.5:
        drive = union([spindle, hub, bar.translate((0, y_high + 22, 0))])
        reach = -np.asarray(drive.bounding_box())[2]
        if reach > spindle_z - 1:
            drive = union([spindle, hub])
    else:
        head = chamfered_hexagon(17, 14).rotate((-90, 0, 0)).translate((0, y_high + 26, 0))
        drive = union([spindle, hub, head])
    pieces.append(ClampBody(name="vice_nut", body=nut_block, material=cast))
    pieces.append(
        ClampBody(
            name="vice_spindle",
            body=drive.translate((0, 0, spindle_z)),
            material=Material.BARE_STEEL,
        )
    )
    heads: list[Manifold] = []
    for sx in (-0.32, 0.32):
        head = socket_screw(8)
        heads.append(head.rotate((90, 0, 0)).translate((sx * width, y_low, top - plate_tall * 0.5)))
    pieces.append(
        ClampBody(name="vice_screws", body=union([*screws, *heads]), material=Material.ZINC)
    )
    return Assembly(bodies=tuple(pieces), table_from_motor=pose)


def _prism_jaw(
    rng: np.random.Generator,
    size: tuple[float, float, float],
    radius_mm: float,
    half_angle_deg: float,
    *,
    upright: bool,
) -> Manifold:
    """A jaw with a V that opens to -y around a cylinder about the origin, along x or z.

    Its size is along the groove, along y behind the apex, and across the groove.
    """
    along, behind, across = size
    half = math.radians(half_angle_deg)
    apex = (radius_mm - PRESS_MM) / math.sin(half)
    face = apex - 0.5 * across / math.tan(half)
    land = float(rng.uniform(0.03, 0.12)) * across
    inner = face + land / math.tan(half)
    outline = [
        (apex, 0.0), (inner, -across / 2 + land), (inner, -across / 2),
        (apex + behind, -across / 2), (apex + behind, across / 2), (inner, across / 2),
        (inner, across / 2 - land),
    ]  # fmt: skip
    body = prism(outline, -along / 2, along / 2)  # first coordinate y, second across, z along
    if upright:
        return body.transform(np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]]))
    return body.transform(np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0]]))


def build_prism_vice(work: Workpiece, rng: np.random.Generator) -> Assembly:
    """A self-centring vice: two V-jaws on one screw close on the yoke, lying or standing."""
    half_angle = float(rng.choice([60.0, 65.0]))
    upright = rng.random() < 0.5
    along = float(rng.uniform(0.35, 0.8)) * min(work.yoke_length_mm, 90)
    if along < 14:
        raise InfeasibleError("yoke too short for jaws")
    grip, side = _grip(rng, work, along, 90 - half_angle + 14)
    flat = _hang(rng, work, grip, side, 90.0 if upright else 0.0, 0.0)
    if upright and rng.random() < 0.5:
        turned = flat.rotation @ np.diag([1.0, -1, -1])
        middle = turned @ (0, 0, grip)
        flat = Transform.from_parts("table", "motor", turned, -middle)
        # turning end over end about x takes the gripped side to the other jaw, which is as bare
    bed = float(rng.uniform(24, 40))
    across = work.radius_mm * float(rng.uniform(1.1, 1.5))
    drop = -work.posed(flat).lowest()
    half_tall = 0.5 * (along if upright else across)
    height = bed + max(half_tall, drop) + float(rng.uniform(3, 14))
    if height - half_tall - bed > 110:
        raise InfeasibleError("the motor would hang too high in the vice")
    pose = Transform.from_parts(
        "table", "motor", flat.rotation, flat.translation_mm + (0, 0, height)
    )
    behind = float(rng.uniform(12, 24))
    jaw = _prism_jaw(rng, (along, behind, across), work.radius_mm, half_angle, upright=upright)
    back = float(np.asarray(jaw.bounding_box())[4])
    carrier_thick = float(rng.uniform(22, 36))
    wide = max(across if upright else along, 50) + float(rng.uniform(4, 20))
    top = height + half_tall * float(rng.uniform(0.5, 0.95))
    carrier = bevelled_box(
        (wide, carrier_thick, top - bed), 2, (0, back + carrier_thick / 2, 0.5 * (top + bed))
    )
    shoe = bevelled_box((wide * 0.8, carrier_thick + 30, 16), 2, (0, back + 20, bed + 8))
    half_long = back + carrier_thick + float(rng.uniform(25, 60))
    material = Material.BARE_STEEL if rng.random() < 0.6 else Material.CAST_ALUMINIUM
    pieces: list[ClampBody] = []
    heads: list[Manifold] = []
    for index, turn in enumerate((0.0, 180.0)):
        pieces.append(
            ClampBody(
                name=f"prism_jaw_{index}",
                body=jaw.rotate((0, 0, turn)).translate((0, 0, height)),
                material=material,
            )
        )
        pieces.append(
            ClampBody(
                name=f"carrier_{index}",
                body=(carrier + shoe).rotate((0, 0, turn)),
                material=Material.PAINTED_STEEL,
                give_mm=0.05,
            )
        )
        for x in (-0.25, 0.25):
            screw = socket_screw(8).rotate((-90, 0, 0))
            screw = screw.translate((x * wide, back + carrier_thick, bed + 0.7 * (top - bed)))
            heads.append(screw.rotate((0, 0, turn)))
    body = bevelled_box((wide * 0.95, 2 * half_long, bed), 2, (0, 0, bed / 2))
    groove = box((wide * 0.34, 2 * half_long - 30, bed), (0, 0, bed * 0.8))
    pieces.append(ClampBody(name="vice_body", body=body - groove, material=Material.CAST_IRON))
    screw_z = bed * 0.62
    spindle = cylinder(min(8.0, 0.26 * bed), -half_long - 8, half_long + 8).rotate((90, 0, 0))
    ends = [
        chamfered_hexagon(14, 10).rotate((-90 * sign, 0, 0)).translate((0, sign * half_long, 0))
        for sign in (-1, 1)
    ]
    pieces.append(
        ClampBody(
            name="vice_spindle",
            body=union([spindle, *ends]).translate((0, 0, screw_z)),
            material=Material.BARE_STEEL,
        )
    )
    for sx in (-1, 1):
        for sy in (-1, 1):
            x, y = sx * (wide * 0.47 + 12), sy * (half_long - 24)
            pieces.append(
                ClampBody(
                    name=f"vice_lug_{sx}_{sy}",
                    body=bevelled_box((30, 30, 12), 1, (x, y, 6)),
                    material=Material.CAST_IRON,
                )
            )
            heads.append(hex_screw(10).translate((x + sx * 2, y, 12)))
    pieces.append(ClampBody(name="vice_screws", body=union(heads), material=Material.ZINC))
    return Assembly(bodies=tuple(pieces), table_from_motor=pose)
