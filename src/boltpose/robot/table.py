"""Tool poses as a plain table (`.csv`)."""

from __future__ import annotations

import csv
import io
import math

from boltpose.geometry.transforms import Transform
from boltpose.robot.angles import fixed
from boltpose.robot.head import scan_hashes
from boltpose.robot.plan import ToolPlan

_POINTS = ("approach", "contact", "retreat")
_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def table_text(plan: ToolPlan) -> str:
    """Write one row per bolt; the first line names the columns with their units.

    Text that a spreadsheet would take for a formula gets a `'` before it.
    """
    result = plan.result
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\r\n")
    pose_columns = [
        f"{point}_{name}"
        for point in _POINTS
        for name in ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    ]
    writer.writerow(
        ["turn", "id", "name", "tool", "side", "visibility", "state", "sure", "confidence"]
        + ["p_tool_fits", "sigma_lateral_mm", "sigma_axial_mm", "sigma_axis_deg"]
        + ["pose", *pose_columns, "warning", "status", "p_correct", "prior", "scan_sha256"]
    )
    for pose in plan.poses:
        bolt = pose.bolt
        fits = "" if bolt.p_tool_fits is None else fixed(bolt.p_tool_fits, 4)
        writer.writerow(
            [pose.turn, _text(bolt.id), _text(bolt.name), _text(bolt.tool), bolt.side.value]
            + [bolt.visibility.value, bolt.state.value, "yes" if bolt.is_sure else "no"]
            + [fixed(bolt.confidence, 4), fits, fixed(bolt.sigma_lateral_mm, 4)]
            + [fixed(bolt.sigma_axial_mm, 4), fixed(math.degrees(bolt.sigma_axis_rad), 4)]
            + [f"base_from_{plan.moved_frame}"]
            + [text for point in _POINTS for text in _numbers(getattr(pose, point))]
            + [_text("; ".join(pose.warnings)), result.verdict.status.value]
            + [fixed(result.verdict.p_correct, 4), _text(result.prior_name)]
            + [" ".join(scan_hashes(result.provenance))]
        )
    return stream.getvalue()


def _numbers(pose: Transform) -> list[str]:
    return [fixed(float(value), 4) for value in pose.translation_mm] + [
        fixed(float(value), 8) for value in pose.quaternion_wxyz
    ]


def _text(text: str) -> str:
    """One line, and no formula."""
    line = " ".join(text.split())
    return f"'{line}" if line.startswith(_FORMULA_STARTS) else line
