"""Section `[locate]` of `boltpose.toml`: what is the same for every scan of a cell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from boltpose.errors import ConfigError

LengthUnitName = Literal["mm", "m", "cm", "inch"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LocateSection:
    """What `boltpose locate` takes where its command line says nothing.

    Section `[locate]` of `boltpose.toml`; relative paths are relative to that file.
    """

    prior: Path | None = None
    """The motor's `.prior.npz`, or a folder of them: which motor is it?"""
    hand_eye: Path | None = None
    """File of `base_from_camera`; of `flange_from_camera` where scans come with robot poses."""
    hand_eye_unit: LengthUnitName = "mm"
    """Unit of that file, and of robot poses. Never that of a hand-eye of the command line."""
    hand_eye_sigma: tuple[float, float] | None = None
    """1 sigma of that hand-eye: mm, degrees. By default from the file's residuals, if any."""
    scan_unit: LengthUnitName = "mm"
    """Unit of the camera's scans."""
    camera: Path | None = None
    """`scene_camera.json` of depth images; other scans do without."""
    models: Path | None = None
    """Folder with other networks than the shipped ones."""
    tool_tolerance: tuple[float, ...] | None = None
    """How far beside (mm), along (mm) and askew (degrees) the tool still grips; one to three."""
    method: Literal["default", "paper"] = "default"
    """Registration; `paper` needs the extra `bench`."""

    def __post_init__(self) -> None:
        if self.hand_eye_sigma is not None:
            _check_positive("hand_eye_sigma", self.hand_eye_sigma, 2, 2)
            if self.hand_eye is None:
                raise ConfigError("hand_eye_sigma needs hand_eye, whose error it is")
        if self.tool_tolerance is not None:
            _check_positive("tool_tolerance", self.tool_tolerance, 1, 3)


def _check_positive(name: str, values: tuple[float, ...], least: int, most: int) -> None:
    if not least <= len(values) <= most:
        count = f"{least}" if least == most else f"{least} to {most}"
        raise ConfigError(f"{name} must be {count} numbers, got {len(values)}")
    if not all(0 < value < math.inf for value in values):
        raise ConfigError(f"{name} must be positive and finite, got {list(values)}")
