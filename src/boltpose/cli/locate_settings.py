"""What `boltpose locate` goes by: its command line, and under it the cell's settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from boltpose.cell import LocateSection
    from boltpose.schema import HandEyeError
    from boltpose.tool_fit import ToolTolerance


class Method(StrEnum):
    """Registration methods by the name a user knows them by."""

    DEFAULT = "default"
    PAPER = "paper"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LocateSettings:
    """Every input of `boltpose locate` but its scans."""

    prior: Path
    hand_eyes: list[Path]
    robot_poses: list[Path]
    scan_unit: str
    hand_eye_unit: str
    hand_eye_sigma: HandEyeError | None
    tool: ToolTolerance | None
    camera: Path | None
    method: str
    models: Path | None

    @property
    def registration_method(self) -> Literal["multi_start", "paper"]:
        """The method as `RegistrationConfig` calls it."""
        return "paper" if self.method == Method.PAPER else "multi_start"


def settle(
    section: LocateSection,
    *,
    scans: Sequence[Path],
    prior: Path | None,
    hand_eyes: list[Path],
    robot_poses: list[Path],
    scan_unit: str | None,
    hand_eye_unit: str | None,
    hand_eye_sigma: str | None,
    tool_tolerance: str | None,
    camera: Path | None,
    method: str | None,
    models: Path | None,
) -> LocateSettings:
    """Fill what the command line leaves open from the cell's settings.

    Unit and sigma of the settings belong to the hand-eye of the settings: one that is named on
    the command line brings its own, or is in mm.

    Raises:
        ConfigError: There is no prior, or an option cannot be read.
    """
    from boltpose.cell.file import require_prior
    from boltpose.cli.locate_inputs import parse_sigma, parse_tool

    is_own_hand_eye = bool(hand_eyes) or section.hand_eye is None
    own_unit = "mm" if hand_eyes else section.hand_eye_unit
    sigma, tool = section.hand_eye_sigma, section.tool_tolerance
    if hand_eye_sigma is None and sigma is not None and not is_own_hand_eye:
        hand_eye_sigma = ",".join(str(value) for value in sigma)
    if tool_tolerance is None and tool is not None:
        tool_tolerance = ",".join(str(value) for value in tool)
    has_depth_image = any(path.suffix.lower() == ".png" for path in scans)
    return LocateSettings(
        prior=require_prior(section, prior),
        hand_eyes=hand_eyes if section.hand_eye is None or hand_eyes else [section.hand_eye],
        robot_poses=robot_poses,
        scan_unit=str(scan_unit or section.scan_unit),
        hand_eye_unit=str(hand_eye_unit or own_unit),
        hand_eye_sigma=parse_sigma(hand_eye_sigma),
        tool=parse_tool(tool_tolerance),
        camera=camera or (section.camera if has_depth_image else None),
        method=str(method or section.method),
        models=models or section.models,
    )
