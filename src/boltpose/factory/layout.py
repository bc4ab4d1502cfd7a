"""Where everything of a motor is: stations along the axis and the axes beside it.

Frame `build`: z = 0 at the joint between the yoke and what stands in front of it, z towards the
nose, x and y as in frame `motor`. Frame `motor` is the same, shifted along z to half way along
the motor's bodies: terminals, heads and what else stands out of them do not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.factory.solids import polar
from boltpose.factory.spec import MotorSpec
from boltpose.geometry.transforms import Transform

FREE_SHAFT_MM = 6.0
"""How far the shaft stands out of a pinion that no front bearing holds."""
SHAFT_INSET_MM = 1.5
"""How far the shaft's end stays behind the mouth of an open front bearing."""
CAP_FALL = 0.5
"""How much lower the rim of a domed or stepped cap is than its middle, in its lengths."""
D_CAP_WALL = 0.12
"""Height of the wall between the terminals of a D-shaped solenoid cap, in the cap's lengths."""
CAP_STEP = (0.6, 0.68)
"""Radii, in those of the cap, between which a stepped cap falls."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Stations in frame `build`, mm. Names end in what they are: `_z` along the axis."""

    yoke_rear_z: float
    """Joint of yoke and rear cap, negative; the yoke's front is z = 0."""
    cap_rear_z: float
    """Flat back of the rear cap."""
    hub_rear_z: float
    """Back of the rear bearing's cup: the rearmost point of the housing."""
    bracket_rear_z: float
    """Joint of gearbox (or yoke, then 0) and bracket."""
    flange_rear_z: float
    flange_front_z: float
    """Front of the mounting flange, foot of the nose."""
    nose_front_z: float
    """Front wall of the nose, or rim of its collar."""
    nose_tip_z: float
    """Front of the bearing's boss: the foremost point of the bracket."""
    shaft_tip_z: float
    """Free end of the pinion's shaft."""
    shaft_xy: tuple[float, float]
    """The pinion's axis, which the bracket's body and the nose share."""
    cap_radius_mm: float
    """Of the rear cap."""
    flange_radius_mm: float
    """Of the bracket's flange without ears."""
    solenoid_xy: tuple[float, float]
    """The solenoid's axis; the main axis where there is none."""
    solenoid_front_z: float
    """Front of the can, back of the bracket's pad. These four are 0 without a solenoid."""
    pad_front_z: float
    can_rear_z: float
    """Back of the can, front of its plastic cap."""
    solenoid_rear_z: float
    """Back of the solenoid's cap, where its studs stand."""
    solenoid_cap_radius_mm: float
    """Of the solenoid's cap; 0 without a solenoid."""
    rear_z: float
    """Rearmost of the motor without terminals."""
    front_z: float
    """Foremost of the motor without terminals."""

    @property
    def motor_from_build(self) -> Transform:
        """Shift to frame `motor`: origin half way along the motor."""
        shift = (0.0, 0.0, -0.5 * (self.rear_z + self.front_z))
        return Transform.from_parts("motor", "build", np.eye(3), shift)

    @property
    def terminal_xy(self) -> tuple[float, float]:
        """Axis that terminals are counted from: the solenoid's, else the main axis."""
        return self.solenoid_xy

    def terminal_z(self, spec: MotorSpec) -> float:
        """Face that the studs stand on: back of the solenoid's cap, else of the rear cap."""
        return self.cap_rear_z if spec.solenoid is None else self.solenoid_rear_z


def lay_out(spec: MotorSpec) -> Layout:
    """Compute every station of a motor."""
    yoke_rear = -spec.housing.length_mm
    cap_rear = yoke_rear - spec.rear_cap.length_mm
    hub_rear = cap_rear - spec.rear_cap.hub_height_mm
    gearbox = spec.gearbox
    bracket_rear = 0.0 if gearbox is None else gearbox.length_mm
    flange_front = bracket_rear + spec.bracket.body_length_mm
    nose = spec.bracket.nose
    nose_front = flange_front + nose.length_mm
    nose_tip = nose_front + (0.0 if nose.style == "stub" else nose.tip_boss_mm)
    gear = spec.gear
    pinion_front = flange_front + gear.gap_mm + gear.clutch_length_mm + gear.width_mm
    is_free = nose.style == "stub"
    shaft_tip = pinion_front + FREE_SHAFT_MM if is_free else nose_tip - SHAFT_INSET_MM
    solenoid = spec.solenoid
    can_rear = solenoid_rear = solenoid_front = pad_front = solenoid_cap_radius = wall = 0.0
    if solenoid is not None:
        solenoid_front = solenoid.front_mm
        pad_front = solenoid_front + solenoid.pad_mm
        can_rear = solenoid_front - solenoid.length_mm
        solenoid_rear = can_rear - solenoid.cap_length_mm
        solenoid_cap_radius = solenoid.cap_radius_mm or 0.93 * solenoid.radius_mm
        wall = D_CAP_WALL * solenoid.cap_length_mm if solenoid.cap_style == "d_shaped" else 0.0
    return Layout(
        yoke_rear_z=yoke_rear,
        cap_rear_z=cap_rear,
        hub_rear_z=hub_rear,
        bracket_rear_z=bracket_rear,
        flange_rear_z=flange_front - spec.bracket.flange_mm,
        flange_front_z=flange_front,
        nose_front_z=nose_front,
        nose_tip_z=nose_tip,
        shaft_tip_z=shaft_tip,
        shaft_xy=(0.0, 0.0)
        if gearbox is None
        else polar(gearbox.shaft_offset_mm, gearbox.shaft_angle_deg),
        cap_radius_mm=spec.rear_cap.radius_mm or spec.housing.radius_mm,
        flange_radius_mm=spec.bracket.flange_radius_mm or spec.bracket.radius_mm,
        solenoid_xy=(0.0, 0.0) if solenoid is None else (0.0, solenoid.offset_mm),
        solenoid_front_z=solenoid_front,
        pad_front_z=pad_front,
        can_rear_z=can_rear,
        solenoid_rear_z=solenoid_rear,
        solenoid_cap_radius_mm=solenoid_cap_radius,
        rear_z=min(hub_rear, solenoid_rear - wall),
        front_z=max(nose_tip, shaft_tip, pad_front),
    )


def cap_back_z(spec: MotorSpec, layout: Layout, radius_mm: float) -> float:
    """Height of the rear cap's back at a distance from the axis, without its hub."""
    cap = spec.rear_cap
    share = radius_mm / layout.cap_radius_mm
    match cap.style:
        case "flat" | "spider":
            return layout.cap_rear_z
        case "domed":
            return layout.cap_rear_z + CAP_FALL * cap.length_mm * min(share, 1.0) ** 2
        case "stepped":
            fall = CAP_FALL * cap.length_mm * (share - CAP_STEP[0]) / (CAP_STEP[1] - CAP_STEP[0])
            return layout.cap_rear_z + min(max(fall, 0.0), CAP_FALL * cap.length_mm)
