"""Pinion, one-way clutch and shaft.

Frame `shaft`: z = 0 on the front of the mounting flange, +z to the shaft's free end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.factory.solids import Manifold, cylinder, prism, turned, union
from boltpose.factory.spec import GearSpec

_PRESSURE_ANGLE_DEG = 20
_PROFILE_SHIFT = 0.35
"""Pinions of starters are shifted outwards, or they would be undercut."""
_FLANK_POINTS = 6
_TIP_CHAMFER = 0.55
"""Chamfer of the teeth in front, in modules: it lets them mesh."""
_STOP_GAP_MM = 1.5
_STOP_MM = 4.0
_CLUTCH_WALL_MM = 1.5
_SLEEVE_MM = 1.8
"""Wall of the sleeve behind the clutch."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GearSolid:
    """The whole pinion shaft as one body in frame `shaft`."""

    body: Manifold
    tip_radius_mm: float
    """Of the teeth."""
    largest_radius_mm: float
    """Of everything: what a nose has to leave free."""
    pinion_z_mm: tuple[float, float]
    """Back and front of the teeth."""


def build_gear(
    spec: GearSpec, *, shaft_front_mm: float, shaft_rear_mm: float = 0, turn_deg: float = 0
) -> GearSolid:
    """Build pinion, clutch and shaft about the z axis.

    Args:
        spec: Its sizes.
        shaft_front_mm: Free end of the shaft, in front of the flange.
        shaft_rear_mm: Where shaft and sleeve end at the back; 0 is the flange's front.
        turn_deg: Turn of the teeth.

    Raises:
        ConfigError: The shaft ends before the pinion, or teeth or clutch have no room for it.
    """
    back = spec.gap_mm + spec.clutch_length_mm
    front = back + spec.width_mm
    if not shaft_front_mm >= front:
        raise ConfigError(f"the shaft ends at {shaft_front_mm:g} mm, its pinion at {front:g} mm")
    root, tip = tooth_radii(spec)
    if not root > 2.2:
        raise ConfigError(f"teeth of module {spec.module_mm:g} leave a core of {root:.2g} mm")
    shaft = min(spec.shaft_radius_mm, root - 0.8)
    if not spec.clutch_radius_mm >= shaft + _CLUTCH_WALL_MM:
        raise ConfigError(
            f"clutch_radius_mm must be at least {shaft + _CLUTCH_WALL_MM:g} around a shaft of "
            f"{shaft:g} mm, got {spec.clutch_radius_mm:g}"
        )
    bodies = [
        _shaft(shaft, shaft_rear_mm, shaft_front_mm),
        _pinion(spec, back, front, turn_deg),
        *_clutch(spec, shaft, shaft_rear_mm),
    ]
    if spec.stop_ring and shaft_front_mm - front > _STOP_GAP_MM + _STOP_MM:
        low = front + _STOP_GAP_MM
        outer = min(1.5 * shaft, 0.9 * tip)
        high, core = low + _STOP_MM, 0.5 * shaft
        ring = [(core, low), (outer, low), (outer, high - 1.2), (outer - 1, high), (core, high)]
        bodies.append(turned(ring))
    return GearSolid(
        body=union(bodies),
        tip_radius_mm=tip,
        largest_radius_mm=max(tip, spec.clutch_radius_mm),
        pinion_z_mm=(back, front),
    )


def tooth_radii(spec: GearSpec) -> tuple[float, float]:
    """Radius at the root and at the tip of the teeth."""
    pitch = spec.module_mm * spec.teeth / 2
    return (
        pitch + (_PROFILE_SHIFT - 1.25) * spec.module_mm,
        pitch + (_PROFILE_SHIFT + 0.85) * spec.module_mm,
    )


def tooth_outline(spec: GearSpec) -> FloatArray:
    """Outline of all teeth, shape (K, 2), counter-clockwise.

    Source:
        Involute of the base circle at 20 degrees, teeth thickened by the profile shift; below
        the base circle the flank goes radially to the root.
    """
    root, tip = tooth_radii(spec)
    pitch = spec.module_mm * spec.teeth / 2
    alpha = math.radians(_PRESSURE_ANGLE_DEG)
    base = pitch * math.cos(alpha)
    half_at_pitch = math.pi / (2 * spec.teeth) + 2 * _PROFILE_SHIFT * math.tan(alpha) / spec.teeth
    radii = np.linspace(max(root, base), tip, _FLANK_POINTS)
    angle = np.arccos(np.clip(base / radii, -1, 1))
    half = half_at_pitch + (math.tan(alpha) - alpha) - (np.tan(angle) - angle)
    half = np.maximum(half, 0.12 * half_at_pitch)  # a pointed tooth keeps a narrow land
    if root < base:
        # the foot widens into the fillet
        radii = np.concatenate([[root], radii])
        half = np.concatenate([[min(half[0] * 1.12, 0.92 * math.pi / spec.teeth)], half])
    flank = np.concatenate([np.stack([radii, -half], 1), np.stack([radii, half], 1)[::-1]])
    outline = [
        np.stack([flank[:, 0] * np.cos(turn), flank[:, 0] * np.sin(turn)], axis=1)
        for turn in (flank[:, 1] + 2 * math.pi * tooth / spec.teeth for tooth in range(spec.teeth))
    ]
    return np.concatenate(outline)


def _pinion(spec: GearSpec, back_mm: float, front_mm: float, turn_deg: float) -> Manifold:
    root, tip = tooth_radii(spec)
    chamfer = min(_TIP_CHAMFER * spec.module_mm, 0.3 * spec.width_mm)
    limit = turned(
        [
            (0, back_mm),
            (tip - 0.3, back_mm),
            (tip + 0.01, back_mm + 0.31),
            (tip + 0.01, front_mm - 0.7 * chamfer),
            (max(tip - 1.5 * chamfer, root + 0.1), front_mm),
            (0, front_mm),
        ]
    )
    teeth = prism(tooth_outline(spec), back_mm, front_mm).rotate((0, 0, turn_deg))
    return teeth ^ limit


def _clutch(spec: GearSpec, shaft_mm: float, rear_mm: float) -> list[Manifold]:
    """Shell with a crimped edge, collar to the pinion, sleeve with the shift lever's guide."""
    radius, length = spec.clutch_radius_mm, spec.clutch_length_mm
    low, high = spec.gap_mm, spec.gap_mm + spec.clutch_length_mm
    edge = min(1.2, 0.2 * length, 0.2 * radius)
    neck = min(radius - edge, max(tooth_radii(spec)[0], shaft_mm + 1.5))
    step = low + 0.78 * length
    shell = turned(
        [
            (0, low),
            (radius - edge, low),
            (radius, low + edge),
            (radius, step - edge),
            (radius - edge, step),
            (max(neck, 0.8 * radius), step),
            (max(neck, 0.8 * radius), high - 0.5),
            (neck, high),
            (0, high),
        ]
    )
    bodies = [shell]
    sleeve = min(shaft_mm + _SLEEVE_MM, 0.85 * radius)
    if low - rear_mm > 0.2:
        bodies.append(cylinder(sleeve, rear_mm, low + 0.5))
    if spec.gap_mm > 9:  # room for the groove that the lever's fork runs in
        bodies.append(cylinder(0.85 * radius, low - 8, low - 6.4))
        bodies.append(cylinder(0.85 * radius, low - 2.2, low - 0.8))
    return bodies


def _shaft(radius_mm: float, rear_mm: float, front_mm: float) -> Manifold:
    edge = 0.15 * radius_mm
    centre = 0.28 * radius_mm
    return turned(
        [
            (0, rear_mm),
            (radius_mm, rear_mm),
            (radius_mm, front_mm - edge),
            (radius_mm - edge, front_mm),
            (centre, front_mm),
            (0, front_mm - 1.2 * centre),
        ]
    )
