"""From located bolts to tool poses: which bolts, in which order, and how the tool stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, FrameError, PosesRefusedError
from boltpose.geometry.transforms import Transform
from boltpose.robot.config import Order, RobotConfig, parse_direction
from boltpose.schema import BoltState, LocatedBolt, LocateResult, Visibility

_LEAST_SINE = math.sin(math.radians(20.0))
"""A direction closer than this to the bolt's axis hardly says how to turn about it: small errors
of the axis would spin the tool, so another direction is taken."""
_LEAST_RADIUS_MM = 50.0
"""Nearer to the base's z axis than this, `outward` says nothing."""
_SEEN = (Visibility.VISIBLE, Visibility.PARTIAL, Visibility.HIDDEN)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ToolPose:
    """Where the tool stands before, at and after one bolt.

    Frame `tool`: origin the tool's tip (the mouth of the socket, the point of the bit), +z into
    the bolt. All three differ only along z of the tool. Source `flange` where a TCP was given.
    """

    turn: int
    """From 1, in the order of the plan."""
    bolt: LocatedBolt
    base_from_tool: Transform
    """At contact, always of the tool's tip."""
    approach: Transform
    contact: Transform
    retreat: Transform
    warnings: tuple[str, ...]
    """What speaks against this bolt although it was asked for."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LeftOut:
    """A bolt that gets no tool pose."""

    bolt: LocatedBolt
    reason: str
    """For a person: what is against it and which setting would take it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ToolPlan:
    """Tool poses in their order, and all that a file about them must say."""

    result: LocateResult
    config: RobotConfig
    poses: tuple[ToolPose, ...]
    left_out: tuple[LeftOut, ...]
    flange_from_tool: Transform | None

    @property
    def moved_frame(self) -> str:
        """`tool` or `flange`: the frame whose poses these are."""
        return "tool" if self.flange_from_tool is None else "flange"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must not be overlooked, one sentence each; empty is good."""
        texts = [f"{pose.bolt.id}: {text}" for pose in self.poses for text in pose.warnings]
        last = max((pose.bolt.order or 0 for pose in self.poses), default=0)
        texts += [
            f"{entry.bolt.id} has turn {entry.bolt.order} in the prior but is left out; bolts "
            "with a later turn follow"
            for entry in self.left_out
            if entry.bolt.order is not None and entry.bolt.order < last
        ]
        return tuple(texts)


def plan_tools(
    result: LocateResult,
    config: RobotConfig | None = None,
    flange_from_tool: Transform | None = None,
) -> ToolPlan:
    """Plan the tool's poses at every bolt that may be approached.

    Args:
        result: Accepted, in frame `base`.
        config: Distances, order, and which bolts.
        flange_from_tool: The TCP. With it approach, contact and retreat are `base_from_flange`,
            without it `base_from_tool`.

    Raises:
        PosesRefusedError: The result is refused, a bolt lies outside the workspace, or none is
            left.
        FrameError: The result is in frame `camera` or its hand-eye is the identity, or the TCP is
            of other frames.
        ConfigError: `min_tool_fits` is wanted of a result that has no `p_tool_fits`.
    """
    config = config or RobotConfig()
    if not result.is_ok:
        reasons = "; ".join(result.verdict.reasons) or "no reason given"
        raise PosesRefusedError(f"the scan was refused ({reasons}): no pose for a robot")
    if result.frame != "base":
        raise FrameError(
            f"the poses are in frame '{result.frame}', a robot needs them in 'base': run "
            "boltpose locate with --hand-eye FILE (base_from_camera)"
        )
    if result.base_from_camera is not None and np.array_equal(
        result.base_from_camera.matrix, np.eye(4)
    ):
        raise FrameError(
            "the hand-eye is the identity, so 'base' is the camera itself, not the robot's: run "
            "boltpose locate with the calibrated --hand-eye FILE"
        )
    _require_within(result, config)
    if flange_from_tool is not None and (flange_from_tool.target, flange_from_tool.source) != (
        "flange",
        "tool",
    ):
        raise FrameError(
            f"the TCP must be flange_from_tool, got "
            f"{flange_from_tool.target}_from_{flange_from_tool.source}"
        )
    if config.min_tool_fits is not None and any(b.p_tool_fits is None for b in result.bolts):
        raise ConfigError(
            "min_tool_fits needs a result with p_tool_fits: run boltpose locate with "
            "--tool-tolerance"
        )
    kept, left_out = [], []
    for bolt in result.bolts:
        reason = _reason_against(bolt, config)
        if reason is None:
            kept.append(bolt)
        else:
            left_out.append(LeftOut(bolt=bolt, reason=reason))
    if not kept:
        listed = "; ".join(f"{entry.bolt.id}: {entry.reason}" for entry in left_out)
        raise PosesRefusedError(f"no bolt is left for a robot ({listed or 'the prior has none'})")
    poses = tuple(
        _pose(turn, bolt, config, flange_from_tool)
        for turn, bolt in enumerate(_in_order(kept, config), start=1)
    )
    return ToolPlan(
        result=result,
        config=config,
        poses=poses,
        left_out=tuple(left_out),
        flange_from_tool=flange_from_tool,
    )


def plan_tool_poses(
    result: LocateResult,
    config: RobotConfig | None = None,
    flange_from_tool: Transform | None = None,
) -> tuple[ToolPose, ...]:
    """Return the tool's poses at every bolt that may be approached, in order.

    Raises:
        PosesRefusedError: The result is refused, a bolt lies outside the workspace, or none is
            left.
        FrameError: The result is in frame `camera` or its hand-eye is the identity, or the TCP is
            of other frames.
        ConfigError: `min_tool_fits` is wanted of a result that has no `p_tool_fits`.
    """
    return plan_tools(result, config, flange_from_tool).poses


def base_from_tool(bolt: LocatedBolt, tool_x: str) -> Transform:
    """Stand the tool on a bolt: tip on `head_top`, +z into the bolt, x by choice.

    Args:
        bolt: In frame `base`.
        tool_x: As in `RobotConfig`.
    """
    into = -bolt.axis
    wanted = _direction(tool_x, bolt.head_top)
    across = wanted - (wanted @ into) * into
    if np.linalg.norm(across) < _LEAST_SINE:
        # the base axis that is most across the wanted one; of equals z, x, y in this order
        axes = np.eye(3)[[2, 0, 1]]
        spare = axes[int(np.argmin(np.round(np.abs(axes @ wanted), 9)))]
        across = spare - (spare @ into) * into
    x_axis = across / np.linalg.norm(across)
    rotation = np.stack([x_axis, np.cross(into, x_axis), into], axis=1)
    return Transform.from_parts("base", "tool", rotation, bolt.head_top)


def _direction(tool_x: str, head_top: FloatArray) -> FloatArray:
    direction = parse_direction(tool_x)
    if not isinstance(direction, str):
        return direction
    radius = math.hypot(head_top[0], head_top[1])
    if radius < _LEAST_RADIUS_MM:
        return np.array([1.0, 0.0, 0.0])
    sign = 1.0 if direction == "outward" else -1.0
    return np.array([sign * head_top[0] / radius, sign * head_top[1] / radius, 0.0])


def _require_within(result: LocateResult, config: RobotConfig) -> None:
    """Of all bolts, also of those that get no pose: a wrong frame moves them all."""
    if config.workspace_mm is None:
        return
    low, high = np.array(config.workspace_mm[::2]), np.array(config.workspace_mm[1::2])
    for bolt in result.bolts:
        if not ((low <= bolt.head_top) & (bolt.head_top <= high)).all():
            where = ", ".join(f"{value:.0f}" for value in bolt.head_top)
            raise PosesRefusedError(
                f"bolt {bolt.id} is at {where} mm, outside workspace_mm "
                f"{list(config.workspace_mm)}: is it the right hand-eye, in the right unit?"
            )


def _reason_against(bolt: LocatedBolt, config: RobotConfig) -> str | None:
    if bolt.state is BoltState.CONTRADICTED and not config.include_contradicted:
        return f"contradicted by the camera ({bolt.state_reason or 'something else is there'})"
    if bolt.visibility is Visibility.HIDDEN and not config.include_hidden:
        return "hidden from the camera (--include-hidden takes it)"
    if not bolt.is_sure and not config.include_unsure:
        why = ", ".join(bolt.remarks) or "no person has confirmed it"
        return f"unsure in the prior: {why} (confirm it there, or --include-unsure takes it)"
    if not bolt.confidence >= config.min_confidence:
        return f"confidence {bolt.confidence:.3f} below {config.min_confidence:g}"
    fits = bolt.p_tool_fits
    if config.min_tool_fits is not None and not (fits or 0.0) >= config.min_tool_fits:
        return f"p_tool_fits {fits or 0.0:.3f} below {config.min_tool_fits:g}"
    # of numpy, because the one of Python may pass over a NaN
    sigma_mm = float(np.maximum(bolt.sigma_lateral_mm, bolt.sigma_axial_mm))
    if config.max_sigma_mm is not None and not sigma_mm <= config.max_sigma_mm:
        return f"sigma {sigma_mm:.2f} mm above {config.max_sigma_mm:g} mm"
    sigma_deg = math.degrees(bolt.sigma_axis_rad)
    if config.max_sigma_axis_deg is not None and not sigma_deg <= config.max_sigma_axis_deg:
        return f"sigma of the axis {sigma_deg:.2f} deg above {config.max_sigma_axis_deg:g} deg"
    return None


def _warnings(bolt: LocatedBolt) -> tuple[str, ...]:
    texts = []
    if bolt.state is BoltState.CONTRADICTED:
        why = bolt.state_reason or "something else is there"
        texts.append(f"CONTRADICTED by the camera ({why}): no tool must go there")
    if bolt.visibility is Visibility.HIDDEN:
        texts.append(
            "hidden: the camera did not see it, its pose comes from the prior alone; "
            "the clamp may be in the way"
        )
    if not bolt.is_sure:
        texts.append("unsure in the prior: no person has confirmed it")
    return tuple(texts)


def _in_order(bolts: list[LocatedBolt], config: RobotConfig) -> list[LocatedBolt]:
    """Turns of the prior first, ids where two are equal; then the rest as configured."""
    first = sorted((b for b in bolts if b.order is not None), key=lambda b: (b.order or 0, b.id))
    rest = sorted((b for b in bolts if b.order is None), key=lambda b: (-b.confidence, b.id))
    if config.order is Order.CONFIDENCE:
        return first + rest
    ordered = list(first)
    while rest:
        # the first of all: the best seen, of these the surest
        here = ordered[-1] if ordered else min(rest, key=lambda b: _SEEN.index(b.visibility))
        # a tie goes to the surer one: `rest` is sorted
        nearest = min(rest, key=lambda b: round(_distance_mm(here, b, config.approach_mm), 6))
        rest.remove(nearest)
        ordered.append(nearest)
    return ordered


def _distance_mm(first: LocatedBolt, second: LocatedBolt, approach_mm: float) -> float:
    """Between the approach points, which are outside the motor: the other side is far away."""
    return float(
        np.linalg.norm(
            first.head_top + approach_mm * first.axis - second.head_top - approach_mm * second.axis
        )
    )


def _pose(
    turn: int, bolt: LocatedBolt, config: RobotConfig, flange_from_tool: Transform | None
) -> ToolPose:
    standing = base_from_tool(bolt, config.tool_x)

    def out_of_head(distance_mm: float) -> Transform:
        return Transform.from_parts(
            "base", "tool", standing.rotation, bolt.head_top + distance_mm * bolt.axis
        )

    def moved(pose: Transform) -> Transform:
        return pose if flange_from_tool is None else pose @ flange_from_tool.inverse()

    contact = out_of_head(config.contact_offset_mm)
    return ToolPose(
        turn=turn,
        bolt=bolt,
        base_from_tool=contact,
        approach=moved(out_of_head(config.contact_offset_mm + config.approach_mm)),
        contact=moved(contact),
        retreat=moved(out_of_head(config.contact_offset_mm + config.retreat_mm)),
        warnings=_warnings(bolt),
    )
