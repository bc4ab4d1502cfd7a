"""Tool poses as a global data list of the KUKA Robot Language."""

from __future__ import annotations

from boltpose.geometry.transforms import Transform
from boltpose.robot.angles import fixed, zyx_angles_deg
from boltpose.robot.head import bolt_label, head_lines, plain_text, scan_id
from boltpose.robot.plan import ToolPlan

NAME_LIMIT = 24
"""Longest name in KRL; Source: KUKA, Quickguide KRL-Syntax (KSS 8.x), "Names in KRL"."""
_CONVENTIONS = (
    "E6POS: X, Y, Z in mm; A, B, C in degrees about z, then the new y, then the new x "
    "(Rz(A) Ry(B) Rx(C)). Rounded to 0.001 mm and 0.0001 deg: at most 0.0009 mm, 0.00015 deg off.",
    "S, T and E1 to E6 are not set: LIN keeps the arm's posture and external axes. Reach the "
    "first approach by a taught PTP.",
    "No line of this file moves the robot. $BASE is that of the hand-eye calibration (as a rule "
    "$NULLFRAME, the robot's foot). Example: FOR I=1 TO BP_COUNT, LIN BP_APPROACH[I], LIN "
    "BP_CONTACT[I], your tool, LIN BP_RETREAT[I].",
)


def kuka_text(plan: ToolPlan, name: str) -> str:
    """Write a `.dat` with arrays of `E6POS`.

    Source: KUKA System Software, expert programming: data lists, aggregates; arrays start at 1.

    Args:
        plan: What to write.
        name: Of the data list, which must be that of the file.
    """
    count = len(plan.poses)
    identity = scan_id(plan)
    lines = ["&ACCESS RVP", "&REL 1", f"DEFDAT {name.upper()} PUBLIC"]
    lines += [f"; {line}".rstrip() for line in head_lines(plan, _CONVENTIONS)]
    lines += [
        "",
        f"DECL GLOBAL INT BP_COUNT={count}",
        f"DECL GLOBAL CHAR BP_SCAN_ID[{len(identity)}]",
        f'BP_SCAN_ID[]="{identity}"',
        *(f"DECL GLOBAL E6POS BP_{point}[{count}]" for point in ("APPROACH", "CONTACT", "RETREAT")),
    ]
    for pose in plan.poses:
        lines.append(f"; {pose.turn}: {bolt_label(pose)}")
        lines += [f"; WARNING {plain_text(text)}" for text in pose.warnings]
        lines += [
            f"BP_APPROACH[{pose.turn}]={pose_literal(pose.approach)}",
            f"BP_CONTACT[{pose.turn}]={pose_literal(pose.contact)}",
            f"BP_RETREAT[{pose.turn}]={pose_literal(pose.retreat)}",
        ]
    lines.append("ENDDAT")
    return "\r\n".join(lines) + "\r\n"


def pose_literal(pose: Transform) -> str:
    """Return `{X .., Y .., Z .., A .., B .., C ..}`, mm and degrees."""
    x, y, z = (fixed(float(value), 3) for value in pose.translation_mm)
    a, b, c = (fixed(value, 4) for value in zyx_angles_deg(pose.rotation))
    return f"{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}"
