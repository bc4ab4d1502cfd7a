"""Pictures an operator judges in five seconds; drawn without a screen or graphics card."""

from boltpose.picture.located import draw_located
from boltpose.picture.prior_views import draw_prior

__all__ = ["draw_located", "draw_prior"]
