"""boltpose: the 6D pose of every bolt of a clamped motor, also of those the camera cannot see."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from boltpose.errors import BoltposeError
    from boltpose.geometry.transforms import Transform
    from boltpose.io.hand_eye import HandEye, hand_eye_error, read_hand_eye
    from boltpose.io.scan import read_scan
    from boltpose.locate import LocateConfig, locate
    from boltpose.locate_views import Shot, locate_views
    from boltpose.picture import draw_located, draw_prior
    from boltpose.prior.build import BuildConfig, build_prior
    from boltpose.prior.edit import add_bolt, confirm_bolt, remove_bolt
    from boltpose.prior.file import read_prior, write_prior
    from boltpose.registration.library import PriorLibrary
    from boltpose.registration.prepare import prepare_prior
    from boltpose.report import write_report
    from boltpose.results import read_poses, write_poses
    from boltpose.robot import RobotConfig, ToolPose, plan_tool_poses
    from boltpose.saved_result import SavedResult, open_saved_result
    from boltpose.schema import (
        BoltState,
        Check,
        HandEyeError,
        LocatedBolt,
        LocateResult,
        Part,
        Prior,
        PriorBolt,
        Scan,
        Side,
        Status,
        Verdict,
        Visibility,
    )
    from boltpose.segmentation.models import Models, load_models
    from boltpose.tool_fit import ToolTolerance
    from boltpose.variants import locate_variant

__all__ = [
    "BoltState",
    "BoltposeError",
    "BuildConfig",
    "Check",
    "HandEye",
    "HandEyeError",
    "LocateConfig",
    "LocateResult",
    "LocatedBolt",
    "Models",
    "Part",
    "Prior",
    "PriorBolt",
    "PriorLibrary",
    "RobotConfig",
    "SavedResult",
    "Scan",
    "Shot",
    "Side",
    "Status",
    "ToolPose",
    "ToolTolerance",
    "Transform",
    "Verdict",
    "Visibility",
    "__version__",
    "add_bolt",
    "build_prior",
    "confirm_bolt",
    "draw_located",
    "draw_prior",
    "hand_eye_error",
    "load_models",
    "locate",
    "locate_variant",
    "locate_views",
    "open_saved_result",
    "plan_tool_poses",
    "prepare_prior",
    "read_hand_eye",
    "read_poses",
    "read_prior",
    "read_scan",
    "remove_bolt",
    "write_poses",
    "write_prior",
    "write_report",
]

_HOMES = {
    "boltpose.errors": ("BoltposeError",),
    "boltpose.geometry.transforms": ("Transform",),
    "boltpose.io.hand_eye": ("HandEye", "hand_eye_error", "read_hand_eye"),
    "boltpose.io.scan": ("read_scan",),
    "boltpose.locate": ("LocateConfig", "locate"),
    "boltpose.locate_views": ("Shot", "locate_views"),
    "boltpose.picture": ("draw_located", "draw_prior"),
    "boltpose.prior.build": ("BuildConfig", "build_prior"),
    "boltpose.prior.edit": ("add_bolt", "confirm_bolt", "remove_bolt"),
    "boltpose.prior.file": ("read_prior", "write_prior"),
    "boltpose.registration.library": ("PriorLibrary",),
    "boltpose.registration.prepare": ("prepare_prior",),
    "boltpose.report": ("write_report",),
    "boltpose.results": ("read_poses", "write_poses"),
    "boltpose.robot": ("RobotConfig", "ToolPose", "plan_tool_poses"),
    "boltpose.saved_result": ("SavedResult", "open_saved_result"),
    "boltpose.segmentation.models": ("Models", "load_models"),
    "boltpose.tool_fit": ("ToolTolerance",),
    "boltpose.variants": ("locate_variant",),
    "boltpose.schema": (
        "BoltState",
        "Check",
        "HandEyeError",
        "LocateResult",
        "LocatedBolt",
        "Part",
        "Prior",
        "PriorBolt",
        "Scan",
        "Side",
        "Status",
        "Verdict",
        "Visibility",
    ),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for: `boltpose --help` needs none of them."""
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module 'boltpose' has no attribute '{name}'")
    value = getattr(import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    def __setattr__(self, name: str, value: Any) -> None:
        # importing the submodule puts it here under the name of its public function, but
        # `from boltpose import locate` must give the function, whatever was imported before
        if name in ("locate", "locate_views") and isinstance(value, ModuleType):
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
