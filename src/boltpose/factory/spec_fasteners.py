"""Bolts and what looks like a bolt, as a person writes them down (mm, degrees)."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class SpecModel(BaseModel):
    """Base of all specifications: unknown keys are errors, numbers are finite, nothing changes."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class HeadKind(StrEnum):
    """Shapes of bolt heads, and the standard that gives their sizes."""

    HEX = "hex"
    """ISO 4017."""
    HEX_FLANGE = "hex_flange"
    """EN 1665."""
    SOCKET_CAP = "socket_cap"
    """ISO 4762."""
    TORX_PAN = "torx_pan"
    """ISO 14583."""
    PHILLIPS_PAN = "phillips_pan"
    """ISO 7045."""
    SLOTTED = "slotted"
    """ISO 1207, cheese head."""


class Site(StrEnum):
    """Where a fastener's head sits. The first word is the body it sits on."""

    REAR_CAP = "rear_cap"
    """On the back of the rear cap, head towards -z; beyond the cap's rim a lug carries it."""
    GEARBOX_REAR = "gearbox_rear"
    """On the back of the gearbox ring (or of the bracket's flange where there is no gearbox),
    outside the yoke, head towards -z."""
    BRACKET_FRONT = "bracket_front"
    """On the front of the bracket's flange, around the nose, head towards +z."""
    RIM_FRONT = "rim_front"
    """On the front of the rim at the bracket's back, behind the mounting flange, head towards +z:
    an ear may stand before it."""
    NOSE_FRONT = "nose_front"
    """On the front face of a closed nose, head towards +z."""
    SOLENOID_FRONT = "solenoid_front"
    """On the front of the bracket's solenoid pad, head towards +z; polar about the solenoid."""
    SOLENOID_REAR = "solenoid_rear"
    """On the back of the solenoid's mounting flange, beside its can, head towards -z; polar about
    the solenoid."""
    SOLENOID_CAP = "solenoid_cap"
    """On the back of the solenoid's cap, head towards -z; polar about the solenoid."""
    YOKE = "yoke"
    """Radially on the yoke's mantle; for distractors only, bolts are parallel to z."""


class BoltSpec(SpecModel):
    """One bolt, parallel to the motor's axis."""

    site: Site
    radius_mm: float = Field(ge=0)
    """Distance from the main axis, at solenoid sites from the solenoid's axis."""
    angle_deg: float
    """Polar angle in the xy-plane of frame `motor`: 0 is +x, 90 is +y, towards the solenoid."""
    head: HeadKind = HeadKind.HEX
    thread_mm: Literal[4, 5, 6, 8] = 6
    """Nominal thread diameter: 5 means M5."""
    across_mm: float | None = Field(default=None, gt=2, lt=25)
    """Spanner size or head diameter; None takes the standard's."""
    head_height_mm: float | None = Field(default=None, gt=0.5, lt=12)
    """From the seat to the top; None takes the standard's."""
    recess_mm: float = Field(default=0, ge=0, le=15)
    """How deep a counterbore sinks the seat below the surface."""
    dish_mm: float = Field(default=0, ge=0, le=1.5)
    """How deep the top of a hexagon is pressed in; 0 for a flat one."""
    washer: bool = False
    roll_deg: float = 0
    """Turn of the head about its axis."""
    shank_mm: float = Field(default=12, ge=2, le=250)
    """Length below the head."""
    clogged: float = Field(default=0, ge=0, le=1)
    """How much of the drive (socket, cross, slot) is filled with dirt."""
    rusty: bool = False
    state: Literal["present", "missing"] = "present"
    """`missing` leaves the lug and an empty hole."""
    id: str | None = Field(default=None, pattern=r"^[A-Za-z0-9_-]{1,20}$")
    """None gives `T1`, `T2` ... to heads towards +z and `B1` ... towards -z, by angle."""


class DistractorKind(StrEnum):
    """What looks like a bolt and is none."""

    NUT = "nut"
    """A nut on a stud."""
    RIVET = "rivet"
    BOSS = "boss"
    """A cast round pad."""
    POLE_SCREW = "pole_screw"
    """A large countersunk screw of a pole shoe, radial on the yoke."""
    HOLE = "hole"
    """An empty threaded hole."""
    DOWEL = "dowel"
    """A pin or tube end."""


class DistractorSpec(SpecModel):
    """One thing that looks like a bolt and is none; it has the class of the body it sits on."""

    kind: DistractorKind
    site: Site
    radius_mm: float = Field(default=0, ge=0)
    """As for a bolt; ignored on the yoke."""
    angle_deg: float
    z_mm: float = 0
    """On the yoke only: distance behind its front end."""
    size_mm: float = Field(default=8, gt=1, lt=25)
    """Diameter, or spanner size of a nut."""
    height_mm: float = Field(default=3, ge=0, lt=20)
    """Above the surface; depth of a hole."""
