"""Where the camera was: a fixed one, or one on the arm with the robot's pose."""

from __future__ import annotations

from pathlib import Path

from boltpose.errors import ConfigError
from boltpose.geometry.transforms import Transform
from boltpose.io.hand_eye import hand_eye_error, read_hand_eye
from boltpose.schema import HandEyeError


def read_camera_pose(
    hand_eye: Path | None, robot_pose: Path | None, unit: str
) -> tuple[Transform | None, HandEyeError | None]:
    """Read the hand-eye matrix; with a robot pose, that of a camera on the arm.

    Args:
        hand_eye: `base_from_camera`, or `flange_from_camera` when a robot pose is given.
        robot_pose: `base_from_flange` at the moment of the scan.
        unit: Unit of both.

    Returns:
        `base_from_camera`, and how well it is known if the file holds residuals; None without
        hand-eye.

    Raises:
        InputFileError: A file holds no rigid transform.
        ConfigError: A robot pose without hand-eye.
    """
    if hand_eye is None:
        if robot_pose is not None:
            raise ConfigError("--robot-pose needs --hand-eye, the camera in the flange")
        return None, None
    if robot_pose is None:
        found = read_hand_eye(hand_eye, unit=unit)
        return found.transform, hand_eye_error(found)
    found = read_hand_eye(hand_eye, unit=unit, target="flange")
    base_from_flange = read_hand_eye(robot_pose, unit=unit, source="flange").transform
    return base_from_flange @ found.transform, hand_eye_error(found)
