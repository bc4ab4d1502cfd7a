"""Which file holds tool poses for which robot."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO

from boltpose.errors import ConfigError, InputFileError
from boltpose.io.atomic import write_atomic
from boltpose.robot import abb, fanuc, kuka
from boltpose.robot.abb import abb_text
from boltpose.robot.fanuc import fanuc_text
from boltpose.robot.kuka import kuka_text
from boltpose.robot.plan import ToolPlan
from boltpose.robot.ros2 import mcap_bytes
from boltpose.robot.table import table_text
from boltpose.robot.urscript import urscript_text


class RobotFormat(StrEnum):
    """Files that hold tool poses; BOP, which holds none, is in `boltpose.robot.bop`."""

    URSCRIPT = "urscript"
    KUKA = "kuka"
    FANUC = "fanuc"
    ABB = "abb"
    ROS2_MCAP = "ros2-mcap"
    CSV = "csv"

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Accepted endings, lower case with dot."""
        return _SUFFIXES[self]


_SUFFIXES = {
    RobotFormat.URSCRIPT: (".script", ".urscript"),
    RobotFormat.KUKA: (".dat",),
    RobotFormat.FANUC: (".ls",),
    RobotFormat.ABB: (".mod", ".modx"),
    RobotFormat.ROS2_MCAP: (".mcap",),
    RobotFormat.CSV: (".csv",),
}
_NAME_LIMITS = {
    RobotFormat.KUKA: kuka.NAME_LIMIT,
    RobotFormat.FANUC: fanuc.NAME_LIMIT,
    RobotFormat.ABB: abb.NAME_LIMIT,
}
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_RESERVED_WORDS = """
alias and axis backward bool brake case channel char circ connect const continue decl def
default defdat deffct div do e3pos e6axis e6pos else elseif end enddat endfct endfor
endfunc endif endloop endmodule endproc endrecord endspline endswitch endtest endtrap
endwhile enum error exit ext false for frame from func global goto halt if import inout
int interrupt is lin local loop mod module nostepin not noview or pers pos proc ptp public
raise readonly real record repeat resume retry return signal step struct switch sysmodule
task test then to trap trigger true trynext undo until var viewonly wait when while with
xor
"""
"""Words of KRL and RAPID that no program can be called."""


def check_program_name(path: str | Path, robot_format: RobotFormat) -> None:
    """Refuse a file name that the controller would not take: the program is called like it.

    Raises:
        InputFileError: The name is too long, has other characters, or is a word of the language.
    """
    limit = _NAME_LIMITS.get(robot_format)
    name = Path(path).stem
    if limit is None:
        return
    if len(name) > limit or not _NAME.fullmatch(name) or name.lower() in _RESERVED_WORDS.split():
        raise InputFileError(
            path,
            f"the name '{name}' for a program of {robot_format.value}",
            f"at most {limit} letters a-z, digits and _, a letter first, and no word of the "
            "language; for example bolts",
        )


def robot_file(
    plan: ToolPlan, robot_format: RobotFormat, name: str = "bolts", stamp_ns: int = 0
) -> bytes:
    """Return the content of a robot's file.

    Args:
        plan: From `plan_tools`.
        robot_format: Whose file.
        name: Of the program; that of the file without its ending.
        stamp_ns: Time of ROS messages, nanoseconds since 1970.

    Raises:
        InputFileError: The name will not do.
        ConfigError: A setting does not fit this plan.
        MissingExtraError: An optional package is needed.
    """
    robot_format = as_format(robot_format)
    check_program_name(name, robot_format)
    if robot_format is RobotFormat.ROS2_MCAP:
        return mcap_bytes(plan, stamp_ns)
    if robot_format is RobotFormat.CSV:
        return table_text(plan).encode("utf-8")
    text = {
        RobotFormat.URSCRIPT: lambda: urscript_text(plan),
        RobotFormat.KUKA: lambda: kuka_text(plan, name),
        RobotFormat.FANUC: lambda: fanuc_text(plan, name),
        RobotFormat.ABB: lambda: abb_text(plan, name),
    }[robot_format]()
    return text.encode("ascii")


def write_robot_file(
    path: str | Path, plan: ToolPlan, robot_format: RobotFormat, stamp_ns: int = 0
) -> None:
    """Write a robot's file; it appears whole or not at all.

    Raises:
        InputFileError: The file's name or ending will not do.
        ConfigError: A setting does not fit this plan.
        MissingExtraError: An optional package is needed.
        OSError: The file cannot be written there.
    """
    robot_format = as_format(robot_format)
    file = Path(path)
    if file.suffix.lower() not in robot_format.suffixes:
        raise InputFileError(
            file, f"the ending '{file.suffix}' for an output", " or ".join(robot_format.suffixes)
        )
    check_program_name(file, robot_format)
    content = robot_file(plan, robot_format, file.stem, stamp_ns)

    def write(stream: BinaryIO) -> None:
        stream.write(content)

    write_atomic(file, write)


def as_format(value: str) -> RobotFormat:
    """Return the format of that name.

    Raises:
        ConfigError: There is none.
    """
    try:
        return RobotFormat(value)
    except ValueError:
        names = ", ".join(one.value for one in RobotFormat)
        raise ConfigError(f"the robot format must be one of {names}, got '{value}'") from None
