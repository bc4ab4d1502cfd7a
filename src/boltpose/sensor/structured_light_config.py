"""Every parameter of the structured-light camera, with its unit and where its value comes from.

Sources named below: [specs] support.zivid.com, Zivid Specs Terminology; [m70] data sheet of the
Zivid 2 M70; [filters] support.zivid.com, 3D settings (outlier, smoothing, contrast distortion and
noise filters); [precision] Lv and Qian, Light: Science & Applications 12, 2023: how camera noise
becomes phase noise and phase noise becomes depth noise; [gamma] Zhang and Huang, Optical
Engineering 46, 2007: fringe-like errors of phase shifting.

Pixel counts, the terms of [specs] and the camera's axes were looked up while this was written. The
figures of [m70] and of the papers are quoted from memory, and what names no source is our own
estimate: put your camera's sheet beside them before you rely on one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np

from boltpose.errors import ConfigError
from boltpose.sensor.camera import Chip, PinholeCamera
from boltpose.sensor.reflectance import Finish

_MAY_BE_NEGATIVE = ("scale_error", "bias_mm")
_POSITIVE = (
    "working_distance_mm",
    "ripple_period_mm",
    "lumps_size_mm",
    "dropout_patch_mm",
    "min_signal",
    "hdr_gain",
)
_SHARES = ("noise_shot_share", "noise_read_share", "mixed_share", "smoothing")


@dataclass(frozen=True, slots=True, kw_only=True)
class StructuredLightConfig:
    """A camera and a projector beside it that throws fringes, like a Zivid."""

    camera: PinholeCamera = Chip.ZIVID_2_PLUS_M60_HALF.camera
    """Where the points are seen from; 1224 x 1024 by default."""
    baseline_mm: float = 120.0
    """The projector stands this far beside the camera, in +x [support.zivid.com, coordinate
    system]; the housings of the Zivid 2 and 2+ are 169 mm wide and leave 110 to 130 mm."""
    working_distance_mm: float = 700.0
    """At which noise and exposure are quoted: the focus distance of the M70 [m70]."""

    noise_mm: float = 0.055
    """Point precision, 1 sigma along the ray, of a matt white surface that faces camera and
    projector at the working distance, in the delivered cloud: 55 um [m70]. Grows with the square
    of the distance, as triangulation does."""
    noise_shot_share: float = 0.4
    """Part of that variance that grows like 1 / signal: photon noise [precision]."""
    noise_read_share: float = 0.3
    """Part that grows like 1 / signal squared: read noise and quantisation [precision]."""
    hdr_gain: float = 6.0
    """The longest exposure of the series is this times longer than the one that suits matt white:
    surfaces down to a sixth of white are as quiet as white [specs, dynamic range]."""
    noise_incidence: float = 0.15
    """Sigma grows by this times the squared tangent of the angle of incidence: a pixel on a
    tilted surface spans a range of depths. Ours: doubles the noise at 69 degrees."""

    min_signal: float = 0.02
    """Pixels that see less are lost; 1 is matt white. Two percent is what an exposure series of
    three shots, fit for bright metal, still resolves [specs, dynamic range]."""
    saturation_signal: float = 2.5
    """Pixels that see more are blown out and lost."""
    highlight_mm: float = 0.12
    """Largest smooth error just below saturation, where clipped fringes shift the phase."""
    max_incidence_deg: float = 82.0
    """Surfaces tilted more, seen from camera or projector, return nothing usable."""
    dropout_spread: float = 0.35
    """Standard deviation, in the logarithm of the signal, of the smooth field and of the pixel
    noise that decide near the limits: losses come in patches with ragged rims."""
    dropout_patch_mm: float = 5.0
    """Size of those patches at the working distance."""

    ripple_mm: float = 0.020
    """Amplitude of fringe-like waves across the projector's columns, from the projector's
    gamma [gamma]."""
    ripple_period_mm: float = 7.0
    """Their period at the working distance: a third of a 20 mm fringe (three-step phase shift)."""
    lumps_mm: float = 0.020
    """Standard deviation of smooth errors over `lumps_size_mm`: local planarity [specs]."""
    lumps_size_mm: float = 12.0
    """Size of the lumps at the working distance."""
    warp_mm: float = 0.040
    """Largest bend of a flat wall over the whole field of view: global planarity trueness
    [specs]."""
    contrast_mm: float = 0.04
    """Error per unit of change of the logarithm of the signal from one column to the next: the
    lens blurs bright stripes into dark neighbours [filters, contrast distortion]."""
    scale_error: float = 0.0
    """All distances from the camera are longer by this share: dimension trueness [specs]. The
    data sheets bound it by 0.002, warm cameras reach a few 0.0001."""
    bias_mm: float = 0.0
    """Added along every ray."""

    edge_mm: float = 1.5
    """Steps in depth from pixel to pixel that count as an edge."""
    mixed_share: float = 0.30
    """Share of edge pixels that see both sides and report a depth in between, 0 to 1."""
    smoothing: float = 1.0
    """How much of a 3 x 3 binomial mean replaces a pixel, 0 to 1; pairs of opposite neighbours
    that are on the same surface take part, so planes keep their place [filters, smoothing]."""
    lone_mm: float = 5.0
    """Neighbours further than this do not support a pixel: the camera's preset [filters,
    outlier]."""
    min_neighbours: int = 3
    """Of eight; pixels with fewer are removed."""
    finish: Finish = field(default_factory=Finish)
    """Stains, rust and differences between parts."""
    is_ideal: bool = False
    """True: no light, no filters, no noise; every point that camera and projector see is
    delivered where it is."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if not isinstance(value, (int, float)):
                continue
            # written so that NaN fails too
            if not math.isfinite(value):
                raise ConfigError(f"{entry.name} must be finite, got {value}")
            if value < 0 and entry.name not in _MAY_BE_NEGATIVE:
                raise ConfigError(f"{entry.name} must be >= 0, got {value}")
            if value > 1 and entry.name in _SHARES:
                raise ConfigError(f"{entry.name} must be at most 1, got {value}")
        for name in _POSITIVE:
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if self.noise_shot_share + self.noise_read_share > 1:
            raise ConfigError(
                "noise_shot_share + noise_read_share must be at most 1, "
                f"got {self.noise_shot_share + self.noise_read_share}"
            )
        if self.saturation_signal <= self.min_signal:
            raise ConfigError(
                f"saturation_signal {self.saturation_signal} must exceed min_signal "
                f"{self.min_signal}"
            )
        if abs(self.scale_error) > 0.05:
            raise ConfigError(f"scale_error must be within 0.05, got {self.scale_error}")
        if self.min_neighbours > 8:
            raise ConfigError(f"min_neighbours must be at most 8, got {self.min_neighbours}")
        if not 0 < self.max_incidence_deg <= 90:
            raise ConfigError(f"max_incidence_deg must be 0 to 90, got {self.max_incidence_deg}")

    def noiseless(self) -> StructuredLightConfig:
        """The same camera and projector without any error: the cloud lies on the surface."""
        return replace(self, is_ideal=True)


def sample_structured_light(
    rng: np.random.Generator, camera: PinholeCamera | None = None
) -> StructuredLightConfig:
    """Draw a camera of a make nobody knows: wide ranges, so that a network trusts none of them.

    The ranges are a factor of about two around the defaults, whose sources are given there.

    Args:
        rng: The source of randomness.
        camera: The chip and lens; None draws a focal length for 1224 x 1024 pixels that sees 35
            to 75 cm at 700 mm.
    """
    chip = camera or PinholeCamera(
        width=1224, height=1024, focal_px=float(np.exp(rng.uniform(np.log(1150), np.log(2100))))
    )

    def around(value: float, factor: float = 2.0) -> float:
        return float(value * factor ** rng.uniform(-1, 1))

    default = StructuredLightConfig()
    return StructuredLightConfig(
        camera=chip,
        baseline_mm=float(rng.uniform(80, 180)),
        working_distance_mm=float(rng.uniform(600, 900)),
        noise_mm=around(default.noise_mm),
        hdr_gain=float(rng.uniform(3, 12)),
        noise_incidence=around(default.noise_incidence),
        min_signal=around(default.min_signal, 1.8),
        saturation_signal=around(default.saturation_signal),
        highlight_mm=around(default.highlight_mm, 2.5),
        max_incidence_deg=float(rng.uniform(76, 86)),
        dropout_spread=around(default.dropout_spread, 1.6),
        dropout_patch_mm=around(default.dropout_patch_mm),
        ripple_mm=around(default.ripple_mm, 2.5),
        ripple_period_mm=around(default.ripple_period_mm),
        lumps_mm=around(default.lumps_mm, 2.5),
        lumps_size_mm=around(default.lumps_size_mm),
        warp_mm=around(default.warp_mm, 2.5),
        contrast_mm=around(default.contrast_mm, 2.5),
        scale_error=float(np.clip(rng.normal(0, 0.0003), -0.001, 0.001)),
        bias_mm=float(rng.normal(0, 0.03)),
        mixed_share=float(rng.uniform(0.1, 0.6)),
        smoothing=float(rng.uniform(0.5, 1.0)),
        min_neighbours=int(rng.integers(2, 5)),
        finish=sample_finish(rng),
    )


def sample_finish(rng: np.random.Generator) -> Finish:
    """Draw how dirty a motor is, from cleaned to scrap yard."""
    return Finish(
        spread=float(rng.uniform(0.1, 0.45)),
        stains=float(rng.uniform(0.1, 0.6)),
        stain_mm=float(np.exp(rng.uniform(np.log(6), np.log(40)))),
        rust_share=float(rng.uniform(0, 0.35)),
    )
