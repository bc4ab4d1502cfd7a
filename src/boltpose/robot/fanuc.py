"""Tool poses as a FANUC teach pendant program in its listing form (`.ls`)."""

from __future__ import annotations

from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.robot.angles import fixed, zyx_angles_deg
from boltpose.robot.config import RobotConfig
from boltpose.robot.head import head_lines, plain_text, scan_id
from boltpose.robot.plan import ToolPlan, ToolPose

NAME_LIMIT = 36
"""Longest program name of R-30iB; older controllers take 8 characters."""
_REMARK_LIMIT = 32
_COMMENT_LIMIT = 16
_LAST_REGISTER = 32000
_CONVENTIONS = (
    "X, Y, Z in mm; W, P, R in degrees about the fixed axes x, then y, then z "
    "(Rz(R) Ry(P) Rx(W)). Rounded to 0.001: at most 0.0009 mm and 0.0015 deg off.",
    "CONFIG is not from the scan: set it for your robot (fanuc_config). UF 0 is the world frame; "
    "it must be the frame of the hand-eye calibration.",
    "No line of this program moves the robot. Bolt n has P[3n-2] approach, P[3n-1] contact, "
    "P[3n] retreat.",
)


def fanuc_text(plan: ToolPlan, name: str) -> str:
    """Write positions, and, where asked for, the lines that copy them into position registers.

    Positions belong to their program; other programs read the registers. None is filled unless
    `fanuc_first_register` says which: they may hold a home position.

    Source: FANUC R-30iB, ASCII program listings as controllers save them (`/PROG`, `/ATTR`,
    `/MN`, `/POS`).

    Args:
        plan: What to write.
        name: Of the program, which must be that of the file.

    Raises:
        ConfigError: The last register does not exist.
    """
    config = plan.config
    conventions = (*_CONVENTIONS, _registers(config, len(plan.poses)))
    remarks = head_lines(plan, conventions, _REMARK_LIMIT)
    # a semicolon ends the line of a program, wherever it stands
    steps = [f"!{remark.replace(';', ',') or '-'}" for remark in remarks]
    if config.fanuc_count_register is not None:
        steps.append(f"R[{config.fanuc_count_register}]={len(plan.poses)}")
    for pose in plan.poses:
        steps.append(f"!{_named(pose, _REMARK_LIMIT - 5)}")
        if config.fanuc_first_register is not None:
            first = config.fanuc_first_register + 3 * (pose.turn - 1)
            steps += [f"PR[{first + k}]=P[{3 * pose.turn - 2 + k}]" for k in range(3)]
    lines = [
        f"/PROG  {name.upper()}",
        "/ATTR",
        "OWNER\t\t= MNEDITOR;",
        f'COMMENT\t\t= "BP {scan_id(plan)}";',
        "PROTECT\t\t= READ_WRITE;",
        "TCD:  STACK_SIZE\t= 0,",
        "      TASK_PRIORITY\t= 50,",
        "      TIME_SLICE\t= 0,",
        "      BUSY_LAMP_OFF\t= 0,",
        "      ABORT_REQUEST\t= 0,",
        "      PAUSE_REQUEST\t= 0;",
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "CONTROL_CODE\t= 00000000 00000000;",
        "/MN",
        *(f"{number:4d}:  {step} ;" for number, step in enumerate(steps, start=1)),
        "/POS",
    ]
    for pose in plan.poses:
        for k, (letter, point) in enumerate(
            (("A", pose.approach), ("C", pose.contact), ("R", pose.retreat))
        ):
            comment = f"{letter} {_named(pose, _COMMENT_LIMIT - 2)}"
            lines += _position(3 * pose.turn - 2 + k, comment, point, config)
    lines.append("/END")
    return "\r\n".join(lines) + "\r\n"


def _registers(config: RobotConfig, count: int) -> str:
    first, counter = config.fanuc_first_register, config.fanuc_count_register
    counted = "" if counter is None else f" R[{counter}] gets the number of bolts."
    if first is None:
        return (
            "No position register is filled. --first-register N copies the positions into PR[N] "
            f"and on, where other programs read them.{counted}"
        )
    last = first + 3 * count - 1
    if last > _LAST_REGISTER:
        raise ConfigError(
            f"fanuc_first_register {first} with {count} bolts needs PR[{last}], "
            f"there are {_LAST_REGISTER} at most"
        )
    return (
        f"Run it to fill PR[{first}] to PR[{last}]: approach, contact, retreat of every bolt."
        f"{counted}"
    )


def _position(number: int, comment: str, pose: Transform, config: RobotConfig) -> list[str]:
    x, y, z = (fixed(float(value), 3) for value in pose.translation_mm)
    r, p, w = (fixed(value, 3) for value in zyx_angles_deg(pose.rotation))
    return [
        f'P[{number}:"{comment}"]{{',
        "   GP1:",
        f"\tUF : {config.fanuc_user_frame}, UT : {config.fanuc_tool},\t\t"
        f"CONFIG : '{config.fanuc_config}',",
        f"\tX = {x:>9}  mm,\tY = {y:>9}  mm,\tZ = {z:>9}  mm,",
        f"\tW = {w:>9} deg,\tP = {p:>9} deg,\tR = {r:>9} deg",
        "};",
    ]


def _named(pose: ToolPose, limit: int) -> str:
    """Number, id and name of a bolt, of letters, digits, blanks and `_`, `-`, `.` alone."""
    text = plain_text(f"{pose.turn} {pose.bolt.id} {pose.bolt.name}")
    kept = "".join(c if c.isalnum() or c in " _-." else " " for c in text)
    return " ".join(kept.split())[:limit].rstrip()
