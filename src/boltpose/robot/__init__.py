"""Poses in the forms robots take."""

from __future__ import annotations

from boltpose.robot.bop import BopTarget, bop_text
from boltpose.robot.config import Order, RobotConfig
from boltpose.robot.files import RobotFormat, robot_file, write_robot_file
from boltpose.robot.plan import LeftOut, ToolPlan, ToolPose, plan_tool_poses, plan_tools

__all__ = [
    "BopTarget",
    "LeftOut",
    "Order",
    "RobotConfig",
    "RobotFormat",
    "ToolPlan",
    "ToolPose",
    "bop_text",
    "plan_tool_poses",
    "plan_tools",
    "robot_file",
    "write_robot_file",
]
