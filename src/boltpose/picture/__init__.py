"""Pictures an operator judges in five seconds; drawn without a screen or graphics card."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from boltpose.picture.located import draw_located
    from boltpose.picture.prior_views import draw_prior

__all__ = ["draw_located", "draw_prior"]

_HOMES = {"draw_located": "boltpose.picture.located", "draw_prior": "boltpose.picture.prior_views"}


def __getattr__(name: str) -> Any:
    """Import a drawing when it is first asked for: most modules here need no matplotlib."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'boltpose.picture' has no attribute '{name}'")
    return getattr(import_module(home), name)
