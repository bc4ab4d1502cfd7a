from __future__ import annotations

from dataclasses import replace

import numpy as np

from boltpose.factory.model import TrueBolt
from boltpose.factory.spec_fasteners import BoltSpec, Site
from boltpose.geometry.transforms import Transform
from boltpose.schema import Side
from boltpose.synthesis.truth import SeenBolt, match_bolts
from boltpose.synthesis.write import rounded

DOWN = np.diag([1.0, -1.0, -1.0])


def bolt(name: str, x: float, z: float, side: Side = Side.TOP) -> TrueBolt:
    rotation = np.eye(3) if side is Side.TOP else DOWN
    return TrueBolt(
        id=name,
        spec=BoltSpec(site=Site.REAR_CAP, radius_mm=abs(x), angle_deg=0),
        side=side,
        motor_from_bolt=Transform.from_parts("motor", "bolt", rotation, (x, 0.0, z)),
        across_mm=10.0,
        head_diameter_mm=11.5,
        head_height_mm=4.0,
    )


def test_bolts_are_found_by_place_whatever_they_are_called_now() -> None:
    scanned = [bolt("T1", -30, 50), bolt("T2", 30, 50), bolt("B1", 30, -50, Side.BOTTOM)]
    # T1 is lost, so the next one is T1 now, with a higher head
    clamped = [bolt("T1", 30, 54), bolt("B1", 30, -50, Side.BOTTOM)]
    assert match_bolts(scanned, clamped) == (None, clamped[0], clamped[1])


def test_a_bolt_on_the_other_end_of_the_same_line_is_another_one() -> None:
    scanned = [bolt("B1", 30, -50, Side.BOTTOM)]
    assert match_bolts(scanned, [bolt("T1", 30, 50)]) == (None,)
    assert match_bolts(scanned, [bolt("B1", 30, -90, Side.BOTTOM)]) == (None,)


def test_visible_needs_both_a_share_and_pixels() -> None:
    seen = SeenBolt(visible_fraction=0.10, pixel_count=30)
    assert seen.is_visible
    assert not replace(seen, visible_fraction=0.099).is_visible
    assert not replace(seen, pixel_count=29).is_visible


def test_rounded_numbers_have_no_negative_zero() -> None:
    assert str(rounded([-1e-9, 0.12345678])) == "[0.0, 0.123457]"
    assert str(rounded(-0.0)) == "0.0"
