"""Settings of what a robot is told: where its tool stands before, at and after every bolt."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError

_NAMED_DIRECTIONS = {
    f"{sign}{axis}": tuple(float(value) for value in (1 if sign == "+" else -1) * np.eye(3)[row])
    for sign in "+-"
    for row, axis in enumerate("xyz")
}
RADIAL_DIRECTIONS = ("outward", "inward")
"""Directions that depend on where the bolt is: away from the base's z axis, or towards it."""
_FANUC_CONFIG = re.compile(r"[NF] [UD]( [LR])? [TB], -?\d, -?\d, -?\d")
_ROS_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_/-]*")


class Order(StrEnum):
    """How bolts follow each other that have no turn of their own in the prior."""

    NEAREST = "nearest"
    """The one whose approach point is nearest to that of the bolt before; the first of all is the
    one seen best."""
    CONFIDENCE = "confidence"
    """The surest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotConfig:
    """Tool poses at the bolts, and which bolts get one.

    Section `[robot]` of `boltpose.toml`.
    """

    approach_mm: float = 50.0
    """From the contact point back along the bolt's axis: where the tool waits before it goes in."""
    retreat_mm: float = 50.0
    """The same, for where it goes after."""
    contact_offset_mm: float = 0.0
    """Where the tool's tip stops, along the axis from the top of the head: 2 stays 2 mm above it,
    -5 goes 5 mm down, as a socket does that swallows the head."""
    tool_x: str = "+x"
    """Where the tool's x axis points as well as it can: `+x` `-x` `+y` `-y` `+z` `-z` of the base,
    three numbers `1,1,0` in the base, or `outward`, `inward` from the base's z axis. A bolt may be
    turned about its axis at will; this makes the choice, the same every time."""
    order: Order = Order.NEAREST
    """Of bolts without a turn in the prior; those with one come first."""
    include_hidden: bool = False
    """Bolts the camera did not see: their pose comes from the prior alone."""
    include_unsure: bool = False
    """Bolts of the prior that no person has confirmed."""
    include_contradicted: bool = False
    """Places where the camera saw something else than the bolt. For tests without a tool only."""
    workspace_mm: tuple[float, float, float, float, float, float] | None = None
    """Where heads of bolts can be in the base: x from, to, y from, to, z from, to. If one of the
    result is elsewhere the frame is wrong (a hand-eye of another unit or camera), and no bolt gets
    a pose. None checks nothing."""
    min_confidence: float = 0.0
    """Bolts below are left out; 0 to 1."""
    min_tool_fits: float | None = None
    """Smallest `p_tool_fits`, 0 to 1; needs a result of `locate --tool-tolerance`."""
    max_sigma_mm: float | None = None
    """Largest sigma beside or along the axis."""
    max_sigma_axis_deg: float | None = None
    """Largest sigma of the axis's direction."""
    tcp: str | None = None
    """File of `flange_from_tool`, 4x4, mm, that makes the poses those of the flange; by default
    they are those of the tool's tip and the controller knows its TCP."""
    fanuc_user_frame: int = 0
    """UF of the positions; 0 is the world frame."""
    fanuc_tool: int = 1
    """UT of the positions."""
    fanuc_config: str = "N U T, 0, 0, 0"
    """CONFIG of the positions: wrist, arm and turns of your robot at the motor."""
    fanuc_first_register: int | None = None
    """First position register that the program fills, three per bolt; None fills none."""
    fanuc_count_register: int | None = None
    """Number register that gets the number of bolts: positions beyond are of an older scan."""
    ros_frame: str = "base"
    """`frame_id` of ROS messages: how your TF tree calls the base."""

    def __post_init__(self) -> None:
        for name in ("approach_mm", "retreat_mm"):
            _check_range(name, getattr(self, name), 1.0, 1000.0, "mm")
        _check_range("contact_offset_mm", self.contact_offset_mm, -100.0, 100.0, "mm")
        for name in ("approach_mm", "retreat_mm"):
            if getattr(self, name) + self.contact_offset_mm <= 0:
                raise ConfigError(
                    f"{name} {getattr(self, name):g} with contact_offset_mm "
                    f"{self.contact_offset_mm:g} does not leave the bolt's head: make it larger"
                )
        parse_direction(self.tool_x)
        if self.workspace_mm is not None:
            sides = zip(self.workspace_mm[::2], self.workspace_mm[1::2], strict=True)
            if not all(-math.inf < low < high < math.inf for low, high in sides):
                raise ConfigError(
                    "workspace_mm must be x from, to, y from, to, z from, to, each smaller than "
                    f"the next, got {list(self.workspace_mm)}"
                )
        object.__setattr__(self, "order", _as_order(self.order))
        _check_range("min_confidence", self.min_confidence, 0.0, 1.0)
        if self.min_tool_fits is not None:
            _check_range("min_tool_fits", self.min_tool_fits, 0.0, 1.0)
        for name in ("max_sigma_mm", "max_sigma_axis_deg"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ConfigError(f"{name} must be positive and finite, got {value}")
        _check_range("fanuc_user_frame", self.fanuc_user_frame, 0, 61)
        _check_range("fanuc_tool", self.fanuc_tool, 1, 29)
        for name in ("fanuc_first_register", "fanuc_count_register"):
            if getattr(self, name) is not None:
                _check_range(name, getattr(self, name), 1, 32000)
        if not _FANUC_CONFIG.fullmatch(self.fanuc_config):
            raise ConfigError(
                f"fanuc_config must look like 'N U T, 0, 0, 0', got '{self.fanuc_config}'"
            )
        if not _ROS_NAME.fullmatch(self.ros_frame):
            raise ConfigError(f"ros_frame must be the name of a TF frame, got '{self.ros_frame}'")


def parse_direction(text: str) -> FloatArray | str:
    """Read a direction in the base.

    Args:
        text: A signed axis, three numbers with commas, or a name of `RADIAL_DIRECTIONS`.

    Returns:
        Shape (3,), unit; or the name as it came.

    Raises:
        ConfigError: It is none of these, or has no length.
    """
    if text in RADIAL_DIRECTIONS:
        return text
    if text in _NAMED_DIRECTIONS:
        return np.array(_NAMED_DIRECTIONS[text])
    wanted = "+x, -x, +y, -y, +z, -z, outward, inward or three numbers like 1,1,0"
    try:
        vector = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise ConfigError(f"tool_x must be {wanted}, got '{text}'") from None
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else 0.0
    if not 1e-6 < length < math.inf:
        raise ConfigError(f"tool_x must be {wanted}, got '{text}'")
    return vector / length


def _as_order(value: str) -> Order:
    try:
        return Order(value)
    except ValueError:
        names = " or ".join(order.value for order in Order)
        raise ConfigError(f"order must be {names}, got '{value}'") from None


def _check_range(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    if not low <= value <= high:  # written so that NaN fails too
        raise ConfigError(f"{name} must be {low:g} to {high:g} {unit}".rstrip() + f", got {value}")
