"""What a request asks for, complete and by content: the same call gives the same answer again."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

from boltpose.errors import ConfigError
from boltpose.io.units import Unit
from boltpose.schema import HandEyeError
from boltpose.service.blobs import Blob
from boltpose.tool_fit import ToolTolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class LocateCall:
    """One `POST /v1/locate`; every file is named by its SHA-256."""

    scans: tuple[Blob, ...]
    priors: tuple[Blob, ...]
    """One motor, or the motors to choose from. The name is that of the file."""
    chooses_prior: bool = False
    """Whether the motor is to be recognised; also with a single prior in the folder."""
    hand_eyes: tuple[Blob, ...] = ()
    robot_poses: tuple[Blob, ...] = ()
    camera: Blob | None = None
    scan_unit: str = "mm"
    hand_eye_unit: str = "mm"
    hand_eye_sigma_mm: float | None = None
    hand_eye_sigma_deg: float | None = None
    tool_lateral_mm: float | None = None
    tool_axial_mm: float | None = None
    tool_angle_deg: float | None = None

    def __post_init__(self) -> None:
        if not self.scans:
            raise ConfigError("scan: found none, wanted at least one")
        if not self.priors:
            raise ConfigError("prior: found none, wanted at least one")
        count = len(self.scans)
        if len(self.priors) > 1:
            object.__setattr__(self, "chooses_prior", True)
        if count > 1 and self.chooses_prior:
            raise ConfigError("several scans need exactly one prior: which motor is it?")
        if self.robot_poses and len(self.robot_poses) != count:
            raise ConfigError(
                f"robot_pose: found {len(self.robot_poses)}, wanted one per scan ({count})"
            )
        if self.robot_poses and not self.hand_eyes:
            raise ConfigError("robot_pose needs hand_eye, the camera in the flange")
        shared = bool(self.robot_poses) and len(self.hand_eyes) == 1
        if count > 1 and len(self.hand_eyes) != count and not shared:
            raise ConfigError(
                f"hand_eye: found {len(self.hand_eyes)}, wanted one per scan ({count}), or one "
                "and a robot_pose per scan"
            )
        if count == 1 and len(self.hand_eyes) > 1:
            raise ConfigError(f"hand_eye: found {len(self.hand_eyes)}, wanted one for one scan")
        for name in ("scan_unit", "hand_eye_unit"):
            if getattr(self, name) not in [unit.value for unit in Unit]:
                units = ", ".join(unit.value for unit in Unit)
                raise ConfigError(f"{name}: found '{getattr(self, name)}', wanted one of {units}")
        for name in (
            "hand_eye_sigma_mm",
            "hand_eye_sigma_deg",
            "tool_lateral_mm",
            "tool_axial_mm",
            "tool_angle_deg",
        ):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ConfigError(f"{name}: found {value}, wanted a positive number")
        if (self.hand_eye_sigma_mm is None) != (self.hand_eye_sigma_deg is None):
            raise ConfigError("hand_eye_sigma_mm and hand_eye_sigma_deg belong together")
        if self.tool_lateral_mm is None and (self.tool_axial_mm or self.tool_angle_deg):
            raise ConfigError("tool_axial_mm and tool_angle_deg need tool_lateral_mm")

    @property
    def blobs(self) -> tuple[Blob, ...]:
        """Every file of the call."""
        camera = () if self.camera is None else (self.camera,)
        return (*self.scans, *self.priors, *self.hand_eyes, *self.robot_poses, *camera)

    @property
    def hand_eye_error(self) -> HandEyeError | None:
        """What the client says of its hand-eye, if anything."""
        if self.hand_eye_sigma_mm is None or self.hand_eye_sigma_deg is None:
            return None
        return HandEyeError(
            translation_sigma_mm=self.hand_eye_sigma_mm,
            rotation_sigma_rad=math.radians(self.hand_eye_sigma_deg),
        )

    @property
    def tool(self) -> ToolTolerance | None:
        """What the client says of its tool, if anything."""
        if self.tool_lateral_mm is None:
            return None
        return ToolTolerance(
            lateral_mm=self.tool_lateral_mm,
            axial_mm=self.tool_axial_mm,
            angle_rad=None if self.tool_angle_deg is None else math.radians(self.tool_angle_deg),
        )

    def to_json(self) -> str:
        """The text that the journal keeps."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> LocateCall:
        """Read what `to_json` wrote.

        Raises:
            ConfigError: It is something else.
        """
        data = _as_object(text)
        lists = ("scans", "priors", "hand_eyes", "robot_poses")
        try:
            files: dict[str, Any] = {
                name: tuple(Blob(**entry) for entry in data.pop(name)) for name in lists
            }
            camera = data.pop("camera")
            return cls(**files, camera=None if camera is None else Blob(**camera), **data)
        except (KeyError, TypeError) as error:
            raise ConfigError(f"no call of this version in the journal ({error})") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildCall:
    """One `POST /v1/priors`."""

    name: str
    scan: Blob
    parts: Blob | None = None
    unit: str | None = None
    use_labels: bool = False
    replace: bool = False

    def __post_init__(self) -> None:
        if self.unit is not None and self.unit not in [unit.value for unit in Unit]:
            units = ", ".join(unit.value for unit in Unit)
            raise ConfigError(f"unit: found '{self.unit}', wanted one of {units}")

    @property
    def blobs(self) -> tuple[Blob, ...]:
        """Every file of the call."""
        return (self.scan,) if self.parts is None else (self.scan, self.parts)

    def to_json(self) -> str:
        """The text that the journal keeps."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> BuildCall:
        """Read what `to_json` wrote.

        Raises:
            ConfigError: It is something else.
        """
        data = _as_object(text)
        try:
            scan, parts = Blob(**data.pop("scan")), data.pop("parts")
            return cls(scan=scan, parts=None if parts is None else Blob(**parts), **data)
        except (KeyError, TypeError) as error:
            raise ConfigError(f"no call of this version in the journal ({error})") from error


def _as_object(text: str) -> dict[str, Any]:
    data = json.loads(text)
    if not isinstance(data, dict):
        raise ConfigError("no call in the journal: wanted a JSON object")
    return data
