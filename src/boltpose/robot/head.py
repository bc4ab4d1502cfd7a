"""What every file for a robot says of itself before its numbers."""

from __future__ import annotations

import math
import re
import textwrap
import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any

from boltpose.robot.config import Order
from boltpose.robot.plan import ToolPlan, ToolPose
from boltpose.schema import LocateResult

LINE_WIDTH = 78
SCAN_ID_LENGTH = 12
"""Hex digits of the scan's SHA-256 that programs can compare; 48 bits, no two scans of a cell."""
_SPELLED = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "oe",
     "Ø": "Oe", "æ": "ae", "Æ": "Ae", "å": "aa", "Å": "Aa", "µ": "u", "°": "deg"}
)  # fmt: skip


def plain_text(text: str, limit: int | None = None) -> str:
    """Make text that no controller can stumble over: printable ASCII in one line.

    Umlauts are spelled out, accents dropped, all else becomes `?`. A bolt may be called anything,
    and a line break in its name must not become a line of a program.

    Args:
        text: Anything.
        limit: Longest result.
    """
    spelled = unicodedata.normalize("NFC", text).translate(_SPELLED)
    bare = "".join(
        character
        for character in unicodedata.normalize("NFKD", spelled)
        if not unicodedata.combining(character)
    )
    ascii_only = "".join(
        character
        if " " <= character <= "~"
        else (" " if character.isspace() or unicodedata.category(character) == "Cc" else "?")
        for character in bare
    )
    return " ".join(ascii_only.split())[:limit].rstrip()


def scan_hashes(provenance: Mapping[str, Any]) -> tuple[str, ...]:
    """SHA-256 of every scan behind a result; empty where it was not made from files."""
    noted = provenance.get("scan_sha256")
    values = noted if isinstance(noted, list) else [noted]
    return tuple(str(value) for value in values if value)


def scan_id(plan: ToolPlan) -> str:
    """First hex digits of the (first) scan's SHA-256, or `unknown`."""
    hashes = scan_hashes(plan.result.provenance)
    clean = re.sub(r"[^0-9a-f]", "", hashes[0].lower()) if hashes else ""
    return clean[:SCAN_ID_LENGTH] or "unknown"


def bolt_label(pose: ToolPose) -> str:
    """Id, name and tool of a bolt in plain text, for comments."""
    bolt = pose.bolt
    text = plain_text(bolt.id)
    if bolt.name:
        text += f" '{plain_text(bolt.name)}'"
    if bolt.tool:
        text += f", tool {plain_text(bolt.tool)}"
    return text


def head_lines(plan: ToolPlan, conventions: tuple[str, ...], width: int = LINE_WIDTH) -> list[str]:
    """Return the head of a robot file: plain ASCII lines of at most `width` characters.

    Args:
        plan: What the file holds.
        conventions: Units, angles and use of this format, one sentence each.
        width: Longest line.
    """
    result = plan.result
    wrapped: list[str] = []
    for text, indent in _texts(plan, result, conventions):
        wrapped += _wrap(text, width, indent) or [""]
    return wrapped


def _texts(
    plan: ToolPlan, result: LocateResult, conventions: tuple[str, ...]
) -> Iterator[tuple[str, str]]:
    """Every sentence of a head with the indent of its further lines; an empty one is a gap."""
    if plan.warnings:
        yield "!!! WARNING !!!", ""
        yield from ((text, "  ") for text in plan.warnings)
        yield "!!! END OF WARNING !!!", ""
        yield "", ""
    yield (
        f"boltpose {result.provenance.get('version', '?')}: tool poses for "
        f"{len(plan.poses)} of {len(result.bolts)} bolts of prior {result.prior_name}",
        "  ",
    )
    yield f"status: {result.verdict.status.value}, p_correct: {result.verdict.p_correct:.4f}", ""
    hashes = scan_hashes(result.provenance) or ("unknown (not made from a file)",)
    yield from ((f"scan SHA-256: {text}", "") for text in hashes)
    yield f"scan id: {scan_id(plan)}", ""
    yield "", ""
    yield from ((text, "  ") for text in (*_meaning(plan), *conventions))
    yield "", ""
    yield from ((text, "   ") for text in _table(plan))
    for entry in plan.left_out:
        yield f"left out {entry.bolt.id}: {entry.reason}", "   "


def _meaning(plan: ToolPlan) -> tuple[str, ...]:
    config = plan.config
    offset = config.contact_offset_mm
    where = (
        "at the middle of the top of the head"
        if offset == 0
        else f"{abs(offset):g} mm {'above' if offset > 0 else 'below'} the top of the head"
    )
    frame = (
        "Poses are base_from_tool: of the tool's tip (TCP), z into the bolt. The controller's TCP "
        "must be set to that tip."
        if plan.flange_from_tool is None
        else "Poses are base_from_flange: the TCP was taken off; use no tool in the controller."
    )
    order = {
        Order.NEAREST: "then the nearest next (between approach points), from the best seen on",
        Order.CONFIDENCE: "then by falling confidence",
    }[config.order]
    return (
        "Follow these poses only while the motor is clamped as it was when this very scan was "
        "taken. After it was moved or a bolt changed, and before the next scan: delete them. "
        "Compare the scan id.",
        "Frame: base, in which the robot's poses were read at the hand-eye calibration.",
        frame,
        f"Contact: {where}. Approach: {config.approach_mm:g} mm out along the bolt's axis from "
        f"contact. Retreat: {config.retreat_mm:g} mm out. All three have one orientation; move "
        "straight between them. The way to approach is yours to plan.",
        f"Turn about the bolt's axis: tool x as near to {config.tool_x} as it goes.",
        f"Order: turns of the prior first, {order}.",
    )


def _table(plan: ToolPlan) -> list[str]:
    rows = ["n  bolt; seen, state; sigma beside/along mm, axis deg; confidence, p_tool_fits"]
    for pose in plan.poses:
        bolt = pose.bolt
        fits = "-" if bolt.p_tool_fits is None else f"{bolt.p_tool_fits:.3f}"
        rows.append(
            f"{pose.turn}  {bolt_label(pose)}; {bolt.visibility.value}, {bolt.state.value}; "
            f"{bolt.sigma_lateral_mm:.2f}/{bolt.sigma_axial_mm:.2f}, "
            f"{math.degrees(bolt.sigma_axis_rad):.2f}; {bolt.confidence:.3f}, {fits}"
        )
    return rows


def _wrap(text: str, width: int, indent: str) -> list[str]:
    """Break a sentence into lines; words longer than a line are broken too."""
    return textwrap.wrap(plain_text(text), width, subsequent_indent=indent)
