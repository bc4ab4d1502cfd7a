"""Settings of the page."""

from __future__ import annotations

from dataclasses import dataclass

from boltpose.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewerConfig:
    """Where the page is served, and how much of a scan is sent and drawn."""

    port: int = 8321
    """Port on this machine; 0 lets the system choose a free one. The page is served on the loopback
    address only: it knows no passwords. From another machine use an SSH tunnel."""
    first_points: int = 60_000
    """Points of a scan that make the first picture: half a megabyte."""
    middle_points: int = 240_000
    """Points that follow at once, wherever the viewer stands."""
    moving_points: int = 300_000
    """While the view moves at most about so many points are drawn."""
    still_points: int = 2_500_000
    """And so many at most once it stands still."""
    detail_px: float = 1.5
    """Finer points are sent where those already there lie farther apart on the screen than this."""
    poll_s: float = 0.5
    """How often files and folders are looked at for something new."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65535:
            raise ConfigError(f"port must be 0 to 65535, got {self.port}")
        for name in ("first_points", "middle_points", "moving_points", "still_points"):
            if not getattr(self, name) >= 1000:
                raise ConfigError(f"{name} must be >= 1000, got {getattr(self, name)}")
        for name in ("detail_px", "poll_s"):
            if not 0 < getattr(self, name) < 100:  # written so that NaN fails too
                raise ConfigError(f"{name} must be in (0, 100), got {getattr(self, name)}")
