"""Tool poses as a RAPID module of ABB."""

from __future__ import annotations

from boltpose.geometry.transforms import Transform
from boltpose.robot.angles import fixed
from boltpose.robot.head import bolt_label, head_lines, plain_text, scan_id
from boltpose.robot.plan import ToolPlan

NAME_LIMIT = 32
"""Longest identifier; Source: ABB, technical reference manual RAPID kernel."""
_CONVENTIONS = (
    "robtarget: position in mm, orientation as a quaternion [q1, q2, q3, q4] = [w, x, y, z]. "
    "Rounded to 0.001 mm and 0.00000001: at most 0.0009 mm and 0.000002 deg off.",
    "The axis configuration [0,0,0,0] is not known: use ConfL\\Off and ConfJ\\Off, and reach the "
    "first approach by a taught joint target. External axes 9E9: none.",
    "No line of this module moves the robot. Work object: wobj0 (world) if that was the frame of "
    "the hand-eye calibration. Example: FOR i FROM 1 TO bpCount, MoveL bpApproach{i}, MoveL "
    "bpContact{i}, your tool, MoveL bpRetreat{i}.",
)


def abb_text(plan: ToolPlan, name: str) -> str:
    """Write a module with arrays of `robtarget`.

    Comments stand between declarations only: within one they are no RAPID.

    Source: ABB, technical reference manual RAPID instructions, functions and data types:
    robtarget, orient; RAPID kernel: array literals, comments.

    Args:
        plan: What to write.
        name: Of the module.
    """
    count = len(plan.poses)
    lines = [f"MODULE {name}"]
    lines += [f"  ! {line}".rstrip() for line in head_lines(plan, _CONVENTIONS)]
    for pose in plan.poses:
        lines += [
            f"  ! WARNING {plain_text(pose.bolt.id)} {plain_text(text)}" for text in pose.warnings
        ]
    lines += [
        "",
        f'  CONST string bpScanId:="{scan_id(plan)}";',
        f"  CONST num bpCount:={count};",
    ]
    for point in ("approach", "contact", "retreat"):
        lines.append("")
        lines += [f"  ! {pose.turn}: {bolt_label(pose)}" for pose in plan.poses]
        lines.append(f"  CONST robtarget bp{point.title()}{{{count}}}:=[")
        rows = [f"    {robtarget_literal(getattr(pose, point))}" for pose in plan.poses]
        lines += [*(f"{row}," for row in rows[:-1]), rows[-1], "  ];"]
    lines.append("ENDMODULE")
    return "\r\n".join(lines) + "\r\n"


def robtarget_literal(pose: Transform) -> str:
    """Return `[[x,y,z],[q1,q2,q3,q4],[0,0,0,0],[9E9,...]]`, mm."""
    position = ",".join(fixed(float(value), 3) for value in pose.translation_mm)
    orient = ",".join(fixed(float(value), 8) for value in pose.quaternion_wxyz)
    return f"[[{position}],[{orient}],[0,0,0,0],[{','.join(['9E9'] * 6)}]]"
