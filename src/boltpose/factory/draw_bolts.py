"""Draws where bolts sit on a motor of one family, and which they are."""

from __future__ import annotations

import math

import numpy as np

from boltpose.factory.bolt_draw import (
    HEADS,
    HEX_LIKE,
    BoltDraw,
    bolt_kind,
    hits_ear,
    is_at_solenoid,
    make_bolt,
    reserve_terminals,
    ring,
)
from boltpose.factory.draw_bolts_solenoid import draw_cap_screws, draw_mount
from boltpose.factory.draws import between, happens, one_of, whole
from boltpose.factory.layout import lay_out
from boltpose.factory.plans import FamilyPlan
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind, Site


def draw_bolts(rng: np.random.Generator, plan: FamilyPlan, spec: MotorSpec) -> MotorSpec:
    """Give a motor its bolts."""
    draw = BoltDraw(rng, plan, spec, lay_out(spec))
    reserve_terminals(draw)
    _through_bolts(draw)
    groups = [_cap_screws, _front_screws, _rim_bolts, _ring_bolts, _nose_screws]
    if spec.solenoid is not None:
        draw_mount(draw)
        groups.append(draw_cap_screws)
    wanted = max(whole(rng, *plan.bolts), len(draw.bolts))
    for index in rng.permutation(len(groups)):
        if len(draw.bolts) < wanted:
            groups[int(index)](draw)
    return spec.model_copy(update={"bolts": tuple(_used(draw, bolt) for bolt in draw.bolts)})


def _used(draw: BoltDraw, bolt: BoltSpec) -> BoltSpec:
    """What happened to a bolt since it was new."""
    rng = draw.rng
    update: dict[str, object] = {
        "roll_deg": between(rng, 0, 360, 1),
        "rusty": happens(rng, 0.2),
        "clogged": between(rng, 0.2, 1.0) if happens(rng, 0.25) else 0.0,
    }
    if bolt.head in (HeadKind.HEX, HeadKind.HEX_FLANGE) and happens(rng, 0.3):
        update["dish_mm"] = between(rng, 0.3, 1.2)
    if happens(rng, 0.04):  # lost once, replaced by what was at hand
        update |= {"head": one_of(rng, HEADS), "across_mm": None, "head_height_mm": None}
    if happens(rng, 0.02):
        update["state"] = "missing"
    return bolt.model_copy(update=update)


def _through_bolts(draw: BoltDraw) -> None:
    """Two to four long bolts from the rear cap to what stands before the yoke."""
    rng, spec = draw.rng, draw.spec
    radius = spec.housing.radius_mm
    count = one_of(rng, (2, 2, 2, 3, 4))
    smallest = 5 if radius > 28 else 4
    kind = bolt_kind(draw, draw.thread(smallest=smallest), heads=HEX_LIKE)
    head = draw.head_mm(make_bolt(kind, site=Site.REAR_CAP, radius_mm=1, angle_deg=0))
    outside = happens(rng, draw.plan.outer_through_bolts)
    if outside:
        reach = radius + 0.5 * int(str(kind["thread_mm"])) + between(rng, 0.8, 3)
    else:
        reach = draw.layout.cap_radius_mm - head - between(rng, 0.5, 3.5) - spec.rear_cap.edge_mm
        reach = max(reach, 0.55 * radius)
    full = spec.housing.length_mm + spec.rear_cap.length_mm
    depth = spec.bracket.body_length_mm if spec.gearbox is None else spec.gearbox.length_mm
    shank = min(round(full + between(rng, 4, max(min(10.0, depth - 4), 4.5)), 1), 249.0)
    recess = between(rng, 1, 4, 1) if not outside and happens(rng, 0.25) else 0.0
    start = between(rng, 0, 360, 1) if not outside else between(rng, -25, 25, 1)
    draw.add(
        [
            make_bolt(
                kind,
                site=Site.REAR_CAP,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=shank,
                recess_mm=min(recess, round(0.3 * spec.rear_cap.length_mm, 1)),
            )
            for angle in ring(draw, count, start)
        ]
    )


def _cap_screws(draw: BoltDraw) -> None:
    """Small screws that hold the brush plate or the bearing's lid."""
    rng, spec = draw.rng, draw.spec
    if spec.rear_cap.style == "spider" or not happens(rng, 0.65):
        return
    kind = bolt_kind(draw, draw.thread(largest=5))
    head = draw.head_mm(make_bolt(kind, site=Site.REAR_CAP, radius_mm=1, angle_deg=0))
    low = spec.rear_cap.hub_radius_mm + head + 2
    high = draw.layout.cap_radius_mm - head - spec.rear_cap.edge_mm - 1
    if high < low:
        return
    reach = between(rng, low, min(high, low + 12), 1)
    start = between(rng, 0, 360, 1)
    draw.add(
        [
            make_bolt(
                kind,
                site=Site.REAR_CAP,
                radius_mm=reach,
                angle_deg=angle,
                shank_mm=min(10.0, 2 + round(0.6 * spec.rear_cap.length_mm, 1)),
            )
            for angle in ring(draw, whole(rng, 2, 3), start)
        ]
    )


def _front_screws(draw: BoltDraw) -> None:
    """Bolts around the nose in the front of the flange, in lugs where they reach out."""
    rng, spec = draw.rng, draw.spec
    if not happens(rng, 0.6):
        return
    kind = bolt_kind(draw, draw.thread(), heads=HEX_LIKE)
    head = draw.head_mm(make_bolt(kind, site=Site.BRACKET_FRONT, radius_mm=1, angle_deg=0))
    nose = spec.bracket.nose.radius_mm + 4
    low = nose + head + 1.5
    high = max(draw.layout.flange_radius_mm - head - 1, low + 0.5)
    count = one_of(rng, (2, 3, 3, 4))
    centre = draw.layout.shaft_xy
    bolts: list[BoltSpec] = []
    for angle in ring(draw, count, between(rng, 0, 360, 1), 6):
        reach = between(rng, low, min(high, low + 6))
        x = centre[0] + reach * math.cos(math.radians(angle))
        y = centre[1] + reach * math.sin(math.radians(angle))
        if hits_ear(draw, x, y, head):
            continue
        bolts.append(
            make_bolt(
                kind,
                site=Site.BRACKET_FRONT,
                radius_mm=round(math.hypot(x, y), 2),
                angle_deg=round(math.degrees(math.atan2(y, x)), 2),
                shank_mm=round(spec.bracket.body_length_mm * 0.8, 1),
                recess_mm=between(rng, 1, 5, 1) if happens(rng, 0.35) else 0.0,
            )
        )
    draw.add(bolts)


def _rim_bolts(draw: BoltDraw) -> None:
    """Bolts in the rim behind the flange, heads forward, some of them under ears."""
    rng, spec = draw.rng, draw.spec
    room = spec.bracket.body_length_mm - spec.bracket.flange_mm - 8
    if room < 5 or not happens(rng, 0.5) or draw.layout.shaft_xy != (0.0, 0.0):
        return
    kind = bolt_kind(draw, draw.thread(largest=5 if room < 8 else 6))
    head = draw.head_mm(make_bolt(kind, site=Site.RIM_FRONT, radius_mm=1, angle_deg=0))
    behind = spec.housing.radius_mm if spec.gearbox is None else spec.gearbox.radius_mm
    reach = max(behind - 0.5 * head, spec.bracket.radius_mm + head + 0.5)
    ears = [ear.angle_deg for ear in spec.bracket.ears]
    angles = ring(draw, one_of(rng, (2, 3, 4)), one_of(rng, ears) + between(rng, -10, 10, 1))
    draw.add(
        [
            make_bolt(
                kind,
                site=Site.RIM_FRONT,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=between(rng, 12, 18, 1),
            )
            for angle in angles
            if not is_at_solenoid(draw, reach, angle, head)
        ]
    )


def _ring_bolts(draw: BoltDraw) -> None:
    """Bolts beside the yoke into the gearbox ring or the bracket, heads to the rear."""
    rng, spec = draw.rng, draw.spec
    if not happens(rng, 0.75 if spec.gearbox is not None else 0.45):
        return
    kind = bolt_kind(draw, draw.thread(), heads=HEX_LIKE)
    head = draw.head_mm(make_bolt(kind, site=Site.GEARBOX_REAR, radius_mm=1, angle_deg=0))
    reach = spec.housing.radius_mm + head + between(rng, 0.9, 2.5)
    if spec.gearbox is not None:
        reach = max(reach, spec.gearbox.radius_mm - head)
        depth = spec.gearbox.length_mm + between(rng, 4, 10, 1)
    else:
        depth = spec.bracket.body_length_mm * 0.8
    angles = ring(draw, one_of(rng, (2, 3, 3, 4)), between(rng, 0, 360, 1), 8)
    draw.add(
        [
            make_bolt(
                kind,
                site=Site.GEARBOX_REAR,
                radius_mm=round(reach, 1),
                angle_deg=angle,
                shank_mm=round(max(depth, 6.0), 1),
            )
            for angle in angles
            if not is_at_solenoid(draw, reach, angle, head)
        ]
    )


def _nose_screws(draw: BoltDraw) -> None:
    """Small screws in the front of a closed nose, where it is wide enough."""
    rng, spec = draw.rng, draw.spec
    nose = spec.bracket.nose
    if nose.style != "closed" or not happens(rng, 0.6):
        return
    kind = bolt_kind(draw, 4)
    head = draw.head_mm(make_bolt(kind, site=Site.NOSE_FRONT, radius_mm=1, angle_deg=0))
    boss = min(0.72 * nose.tip_radius_mm, spec.gear.shaft_radius_mm + 6.5)
    low, high = boss + head + 0.6, nose.tip_radius_mm - head - 0.3
    if high < low or draw.layout.shaft_xy != (0.0, 0.0):
        return
    draw.add(
        [
            make_bolt(
                kind,
                site=Site.NOSE_FRONT,
                radius_mm=between(rng, low, high),
                angle_deg=angle,
                shank_mm=6,
            )
            for angle in ring(draw, whole(rng, 2, 3), between(rng, 0, 360, 1))
        ]
    )
