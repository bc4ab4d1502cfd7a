"""Every parameter of the hand-held laser scanner, with its unit and where its value comes from.

Sources named below: [t-scan] data sheets of the Leica and Zeiss T-Scan (a laser line swept by
hand, tracked from outside); [manual] Leica T-Scan manual, surface mode. Their figures are quoted
from memory, and what names no source is our own estimate: put your scanner's sheet beside them
before you rely on one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np

from boltpose.errors import ConfigError
from boltpose.sensor.reflectance import Finish
from boltpose.sensor.structured_light_config import sample_finish

_SHARES = ("stray_share",)


@dataclass(frozen=True, slots=True, kw_only=True)
class HandHeldConfig:
    """A laser line swept over a motor from all around, and the fusion of all strips."""

    directions: int = 32
    """From how many sides the motor is scanned: what a careful operator does in some minutes."""
    strip_mm: float = 100.0
    """Width of a strip, the length of the laser line [t-scan]."""
    pitch_mm: float = 0.8
    """Distance of lines, and of points along a line [manual: 0.075 mm steps, set by the user]."""
    triangulation_deg: float = 25.0
    """Angle between laser and detector. Both must reach a point, so a slot along the line that is
    deeper than its width / tan(angle) is not measured at its bottom. From a stand-off of 150 mm
    and 60 to 80 mm between the lenses [t-scan]."""

    noise_mm: float = 0.035
    """1 sigma along the beam at normal incidence: 80 um for 2 sigma on planes [t-scan]."""
    noise_incidence: float = 0.25
    """Sigma grows by this times the squared tangent of the angle of incidence. Ours."""
    strip_shift_mm: float = 0.025
    """1 sigma per axis of a strip's position: 60 um for 2 sigma of the tracker over a few metres
    [t-scan]."""
    strip_turn_deg: float = 0.010
    """1 sigma per axis of a strip's orientation: the tracker's angle."""

    min_signal: float = 0.025
    """Points that return less are lost; 1 is matt white. The scanner adapts its power per point,
    so black plastic is mostly kept [t-scan]."""
    saturation_signal: float = 3.0
    """Points that return more are lost: mirror reflections into the detector."""
    max_incidence_deg: float = 75.0
    """Surfaces tilted more, seen from laser or detector, are not measured."""
    dropout_spread: float = 0.4
    """Standard deviation of the doubt, in the logarithm of the signal, near these limits."""
    dropout_patch_mm: float = 6.0
    """Size of the patches that are lost together."""
    missed_patches: float = 2.5
    """Mean number of spots that the operator forgot."""
    missed_radius_mm: float = 7.0
    """Median radius of such a spot."""
    stray_share: float = 0.001
    """Share of points off the surface: reflections, dust, edges seen by half."""
    stray_mm: float = 2.5
    """Mean distance by which they are off along the beam."""

    cell_mm: float = 1.0
    """Fusion keeps one random point per cube of this size."""
    finish: Finish = field(default_factory=Finish)
    """Stains, rust and differences between parts."""
    is_ideal: bool = False
    """True: every point that laser and detector reach is measured where it is."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if not isinstance(value, (int, float)):
                continue
            # written so that NaN fails too
            if not (math.isfinite(value) and value >= 0):
                raise ConfigError(f"{entry.name} must be finite and >= 0, got {value}")
            if value > 1 and entry.name in _SHARES:
                raise ConfigError(f"{entry.name} must be at most 1, got {value}")
        for name in ("strip_mm", "pitch_mm", "cell_mm", "dropout_patch_mm", "min_signal"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if self.directions < 1:
            raise ConfigError(f"directions must be >= 1, got {self.directions}")
        if self.saturation_signal <= self.min_signal:
            raise ConfigError(
                f"saturation_signal {self.saturation_signal} must exceed min_signal "
                f"{self.min_signal}"
            )
        if not 0 < self.triangulation_deg < 80:
            raise ConfigError(f"triangulation_deg must be 0 to 80, got {self.triangulation_deg}")
        if not 0 < self.max_incidence_deg <= 90:
            raise ConfigError(f"max_incidence_deg must be 0 to 90, got {self.max_incidence_deg}")

    def noiseless(self) -> HandHeldConfig:
        """The same sweeps without any error: what is reached lies on the surface."""
        return replace(self, is_ideal=True)


def sample_hand_held(rng: np.random.Generator) -> HandHeldConfig:
    """Draw a scanner and an operator: wide ranges, so that a network trusts none of them.

    The ranges are a factor of about two around the defaults, whose sources are given there.
    """

    def around(value: float, factor: float = 2.0) -> float:
        return float(value * factor ** rng.uniform(-1, 1))

    default = HandHeldConfig()
    return HandHeldConfig(
        directions=int(rng.integers(20, 41)),
        strip_mm=float(rng.uniform(60, 140)),
        triangulation_deg=float(rng.uniform(16, 34)),
        noise_mm=around(default.noise_mm),
        noise_incidence=around(default.noise_incidence),
        strip_shift_mm=around(default.strip_shift_mm),
        strip_turn_deg=around(default.strip_turn_deg),
        min_signal=around(default.min_signal, 1.8),
        saturation_signal=around(default.saturation_signal),
        max_incidence_deg=float(rng.uniform(66, 80)),
        dropout_spread=around(default.dropout_spread, 1.6),
        dropout_patch_mm=around(default.dropout_patch_mm),
        missed_patches=float(rng.uniform(0, 6)),
        missed_radius_mm=float(rng.uniform(4, 12)),
        stray_share=float(rng.uniform(0.0002, 0.003)),
        stray_mm=float(rng.uniform(1, 4)),
        cell_mm=float(rng.uniform(0.8, 1.2)),
        finish=sample_finish(rng),
    )
