"""One small motor that the tests of wear, changes and exports share."""

from __future__ import annotations

from functools import cache

import numpy as np

from boltpose.arrays import IntArray
from boltpose.factory.build import build_motor
from boltpose.factory.model import MotorModel, SolidPart
from boltpose.factory.spec import MotorSpec, PlugSpec, StudSpec, TerminalsSpec
from boltpose.factory.spec_fasteners import BoltSpec, HeadKind, Site

BOLTS = (
    BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=0, head=HeadKind.HEX, thread_mm=5),
    BoltSpec(
        site=Site.REAR_CAP,
        radius_mm=28,
        angle_deg=180,
        head=HeadKind.HEX_FLANGE,
        thread_mm=6,
        rusty=True,
    ),
    BoltSpec(site=Site.REAR_CAP, radius_mm=28, angle_deg=-90, head=HeadKind.TORX_PAN, thread_mm=5),
)
SPEC = MotorSpec(
    name="small",
    bolts=BOLTS,
    terminals=TerminalsSpec(
        studs=(StudSpec(angle_deg=60), StudSpec(angle_deg=-60)), plug=PlugSpec(angle_deg=180)
    ),
)


@cache
def small_motor() -> MotorModel:
    """Three bolts at the rear cap, two studs, a plug and a cable."""
    return build_motor(SPEC)


def is_closed(faces: IntArray) -> bool:
    """Every edge is walked once in each direction: closed, oriented, 2-manifold."""
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = np.sort(ways[:, 0] * (faces.max() + 1) + ways[:, 1])
    back = np.sort(ways[:, 1] * (faces.max() + 1) + ways[:, 0])
    return bool((np.diff(there) > 0).all() and (there == back).all())


def volume_mm3(solid: SolidPart) -> float:
    """Enclosed volume, by the divergence theorem."""
    corners = solid.vertices[solid.faces]
    crosses = np.cross(corners[:, 1], corners[:, 2])
    return float((corners[:, 0] * crosses).sum() / 6)
