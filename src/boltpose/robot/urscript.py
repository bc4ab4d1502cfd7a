"""Tool poses as a URScript of Universal Robots."""

from __future__ import annotations

from boltpose.arrays import FloatArray
from boltpose.geometry.transforms import Transform
from boltpose.robot.angles import fixed, rotation_vector_rad
from boltpose.robot.head import bolt_label, head_lines, plain_text, scan_id
from boltpose.robot.plan import ToolPlan

_DECIMALS = 6
_CONVENTIONS = (
    "Poses p[x, y, z, rx, ry, rz]: metres, and a rotation vector (axis times angle) in radians. "
    "Rounded to 0.000001: at most 0.0009 mm and 0.00005 deg off.",
    "No line of this file moves the robot. Insert it as a script file; then call "
    "boltpose_approach(i), boltpose_contact(i), boltpose_retreat(i), i from 1 to boltpose_count.",
)
_POINTS = ("approach", "contact", "retreat")


def urscript_text(plan: ToolPlan) -> str:
    """Write global variables with every pose, and functions that pick one by its number.

    The file has no `def` around it: PolyScope inserts it before the nodes that use it. Asked for
    a bolt that is not there, the functions stop the program.

    Source: Universal Robots, script manual: `p[...]`, `global`, `def`, `popup`, `halt`.
    """
    lines = [f"# {line}".rstrip() for line in head_lines(plan, _CONVENTIONS)]
    lines += [
        "",
        f'global boltpose_scan_id = "{scan_id(plan)}"',
        f"global boltpose_count = {len(plan.poses)}",
    ]
    for pose in plan.poses:
        lines.append(f"# {pose.turn}: {bolt_label(pose)}")
        lines += [f"# WARNING {plain_text(text)}" for text in pose.warnings]
        for point in _POINTS:
            value = pose_literal(getattr(pose, point))
            lines.append(f"global boltpose_{point}_{pose.turn} = {value}")
    for point in _POINTS:
        lines += ["", f"def boltpose_{point}(i):"]
        for pose in plan.poses:
            lines += [
                f"  {'if' if pose.turn == 1 else 'elif'} i == {pose.turn}:",
                f"    return boltpose_{point}_{pose.turn}",
            ]
        lines += [
            "  end",
            '  popup("no bolt of this number", title="boltpose", error=True, blocking=True)',
            "  halt",
            "end",
        ]
    return "\n".join(lines) + "\n"


def pose_literal(pose: Transform) -> str:
    """Return `p[x, y, z, rx, ry, rz]`, metres and radians."""
    numbers: tuple[FloatArray, ...] = (
        pose.translation_mm / 1000.0,
        rotation_vector_rad(pose.rotation),
    )
    texts = [fixed(float(value), _DECIMALS) for part in numbers for value in part]
    return f"p[{', '.join(texts)}]"
