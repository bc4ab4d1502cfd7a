"""Draws studs, plug and cable."""

from __future__ import annotations

import numpy as np

from boltpose.factory.draws import between, happens, one_of
from boltpose.factory.spec import (
    CableSpec,
    HousingSpec,
    PlugSpec,
    SolenoidSpec,
    StudSpec,
    TerminalsSpec,
)


def draw_terminals(
    rng: np.random.Generator, housing: HousingSpec, solenoid: SolenoidSpec | None
) -> TerminalsSpec:
    """Draw the terminals of a motor, on the solenoid's cap or, without one, on the rear cap."""
    if solenoid is None:
        face = housing.radius_mm
        stud = StudSpec(
            radius_mm=round(face * between(rng, 0.5, 0.62), 1),
            angle_deg=between(rng, 40, 140, 1),
            thread_mm=one_of(rng, (5, 6, 8)),
            length_mm=between(rng, 12, 24, 1),
            nuts=one_of(rng, (1, 2)),
        )
        return TerminalsSpec(studs=(stud,), plug=None, cable=None)
    face = solenoid.cap_radius_mm or 0.93 * solenoid.radius_mm
    top = between(rng, 30, 75, 1)
    thread = one_of(rng, (6, 8)) if face < 26 else one_of(rng, (8, 10))
    studs = (
        StudSpec(
            radius_mm=round(face * between(rng, 0.45, 0.6), 1),
            angle_deg=top,
            thread_mm=thread,
            length_mm=between(rng, 14, 26, 1),
            nuts=one_of(rng, (1, 1, 2)),
            bend_deg=between(rng, 0, 7, 1) if happens(rng, 0.25) else 0,
        ),
        StudSpec(
            radius_mm=round(face * between(rng, 0.45, 0.6), 1),
            angle_deg=between(rng, -110, -60, 1),
            thread_mm=thread,
            length_mm=between(rng, 14, 24, 1),
            nuts=1,
        ),
    )
    plug = None
    if happens(rng, 0.7):
        plug = PlugSpec(
            radius_mm=round(face * between(rng, 0.5, 0.62), 1),
            angle_deg=between(rng, 150, 200, 1),
            size_mm=(between(rng, 9, 15, 1), between(rng, 7, 11, 1), between(rng, 10, 20, 1)),
            on_side=happens(rng, 0.35),
            kind=one_of(rng, ("box", "blade", "round")),
        )
    cable = None
    if happens(rng, 0.85):
        cable = CableSpec(
            stud=1,
            radius_mm=between(rng, 2.8, 4.8, 1),
            kind=one_of(rng, ("cable", "braid", "bar")),
            enters=one_of(rng, ("yoke", "rear_cap")),
            sag_mm=between(rng, 2, 8, 1),
        )
    return TerminalsSpec(studs=studs, plug=plug, cable=cable)
