"""Draws the bolts that hold the solenoid and its cap."""

from __future__ import annotations

from boltpose.factory.bolt_draw import AIR_MM, HEX_LIKE, BoltDraw, bolt_kind, make_bolt, ring
from boltpose.factory.draws import between, happens, whole
from boltpose.factory.spec_fasteners import Site


def draw_mount(draw: BoltDraw) -> None:
    """Two or three bolts that hold the solenoid: through the pad, or through its own flange."""
    rng, solenoid = draw.rng, draw.spec.solenoid
    assert solenoid is not None
    kind = bolt_kind(draw, draw.thread(smallest=5), heads=HEX_LIKE)
    head = draw.head_mm(make_bolt(kind, site=Site.SOLENOID_FRONT, radius_mm=1, angle_deg=0))
    tilt = between(rng, -14, 40, 1)
    angles = [tilt, 180 - tilt] + ([90.0] if happens(rng, 0.35) else [])
    # a broad pad has room for heads inside the can's circle, a bridge in its middle has not
    nearest = 0.64 if solenoid.lever_style in ("plate", "ribbed") else 0.8
    has_flange = solenoid.flange_radius_mm is not None and happens(rng, 0.6)
    if has_flange or draw.plan.gear_train == "coaxial":
        site, reach = Site.SOLENOID_REAR, solenoid.radius_mm + head + between(rng, 0.8, 2.5)
        shank = solenoid.flange_mm + 0.7 * solenoid.pad_mm
    else:
        site, reach = Site.SOLENOID_FRONT, solenoid.radius_mm * between(rng, nearest, 1.08)
        shank = solenoid.pad_mm + between(rng, 4, 9)
        if solenoid.plunger_boot:
            reach = max(reach, 0.6 * solenoid.radius_mm + head + 1)
    draw.add(
        [
            make_bolt(
                kind,
                site=site,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=round(max(shank, 4.0), 1),
            )
            for angle in angles
        ]
    )


def draw_cap_screws(draw: BoltDraw) -> None:
    """Two or three screws through the plastic cap."""
    rng, solenoid = draw.rng, draw.spec.solenoid
    assert solenoid is not None
    if not happens(rng, 0.7):
        return
    kind = bolt_kind(draw, draw.thread(largest=5))
    head = draw.head_mm(make_bolt(kind, site=Site.SOLENOID_CAP, radius_mm=1, angle_deg=0))
    reach = 0.86 * draw.layout.solenoid_cap_radius_mm - head - between(rng, 0.4, 1.5)
    if solenoid.cap_style != "round" or reach < head + 4:
        reach = 0.74 * draw.layout.solenoid_cap_radius_mm - head
    if reach < 6:
        return
    depth = min(solenoid.cap_length_mm - 3, 14.0)
    count = whole(rng, 2, 4)
    origin = draw.layout.solenoid_xy
    starts = [between(rng, 0, 360, 1) for _ in range(12)]
    # the turn that leaves most of the screws clear of studs and plug
    clear = [
        sum(
            draw.bottom.is_free(reach, start + 360 * index / count, head + AIR_MM + 1, origin)
            for index in range(count)
        )
        for start in starts
    ]
    start = starts[clear.index(max(clear))]
    draw.add(
        [
            make_bolt(
                kind,
                site=Site.SOLENOID_CAP,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=round(max(depth, 3.0), 1),
                recess_mm=between(rng, 0.5, 3, 1) if happens(rng, 0.4) else 0.0,
            )
            for angle in ring(draw, count, start, 2)
        ]
    )
