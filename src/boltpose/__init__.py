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
    from boltpose.io.hand_eye import HandEye, read_hand_eye
    from boltpose.io.scan import read_scan
    from boltpose.locate import LocateConfig, locate
    from boltpose.picture import draw_located, draw_prior
    from boltpose.prior.build import BuildConfig, build_prior
    from boltpose.prior.edit import add_bolt, confirm_bolt, remove_bolt
    from boltpose.prior.file import read_prior, write_prior
    from boltpose.registration.prepare import prepare_prior
    from boltpose.results import read_poses, write_poses
    from boltpose.schema import (
        Check,
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

__all__ = [
    "BoltposeError",
    "BuildConfig",
    "Check",
    "HandEye",
    "LocateConfig",
    "LocateResult",
    "LocatedBolt",
    "Models",
    "Part",
    "Prior",
    "PriorBolt",
    "Scan",
    "Side",
    "Status",
    "Transform",
    "Verdict",
    "Visibility",
    "__version__",
    "add_bolt",
    "build_prior",
    "confirm_bolt",
    "draw_located",
    "draw_prior",
    "load_models",
    "locate",
    "prepare_prior",
    "read_hand_eye",
    "read_poses",
    "read_prior",
    "read_scan",
    "remove_bolt",
    "write_poses",
    "write_prior",
]

_HOMES = {
    "boltpose.errors": ("BoltposeError",),
    "boltpose.geometry.transforms": ("Transform",),
    "boltpose.io.hand_eye": ("HandEye", "read_hand_eye"),
    "boltpose.io.scan": ("read_scan",),
    "boltpose.locate": ("LocateConfig", "locate"),
    "boltpose.picture": ("draw_located", "draw_prior"),
    "boltpose.prior.build": ("BuildConfig", "build_prior"),
    "boltpose.prior.edit": ("add_bolt", "confirm_bolt", "remove_bolt"),
    "boltpose.prior.file": ("read_prior", "write_prior"),
    "boltpose.registration.prepare": ("prepare_prior",),
    "boltpose.results": ("read_poses", "write_poses"),
    "boltpose.segmentation.models": ("Models", "load_models"),
    "boltpose.schema": (
        "Check",
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
        # importing the submodule `locate` puts it here under the name of the public function;
        # `from boltpose import locate` must give the function, whatever was imported before
        if name == "locate" and isinstance(value, ModuleType):
            value = value.locate
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
