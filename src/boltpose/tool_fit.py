"""The probability that a tool lands on a bolt whose pose is known to a covariance only."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, ShapeError

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(128)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolTolerance:
    """What a tool forgives: a socket or bit that comes down along the stated axis."""

    lateral_mm: float
    """Farthest that the bolt's axis may be beside the tool's: half the play of socket on head, or
    the catch of its chamfer."""
    axial_mm: float | None = None
    """Farthest that the head's top may be above or below where it is stated; None if the tool
    feels its way down."""
    angle_rad: float | None = None
    """Largest angle between the two axes; None if the tool gives way."""

    def __post_init__(self) -> None:
        for name in ("lateral_mm", "axial_mm", "angle_rad"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ConfigError(f"{name} must be positive and finite, got {value}")


def tool_fit_probability(
    covariance_mm2: FloatArray,
    axis: FloatArray,
    sigma_axis_rad: float,
    head_height_mm: float,
    tool: ToolTolerance,
) -> float:
    """Probability that the tool lands, the errors being normal.

    The tilt's error moves the head's foot beside its top: its lever is the height of the head.

    Args:
        covariance_mm2: Shape (3, 3), of the head's top, any frame.
        axis: Shape (3,), unit, out of the head, same frame.
        sigma_axis_rad: 1 sigma of the axis direction, in either direction.
        head_height_mm: How far the tool goes down.
        tool: What it forgives.

    Returns:
        0 to 1.

    Raises:
        ShapeError: An argument has another shape.
    """
    covariance = np.asarray(covariance_mm2, dtype=np.float64)
    direction = np.asarray(axis, dtype=np.float64)
    if covariance.shape != (3, 3) or direction.shape != (3,):
        raise ShapeError(
            f"covariance_mm2 and axis must have shapes (3, 3) and (3,), "
            f"got {covariance.shape} and {direction.shape}"
        )
    # two directions across the axis
    across = np.linalg.svd(direction[None])[2][1:]
    lateral = across @ covariance @ across.T
    lateral = lateral + (sigma_axis_rad * head_height_mm) ** 2 * np.eye(2)
    variances = np.linalg.eigvalsh(0.5 * (lateral + lateral.T))
    small, large = np.sqrt(np.maximum(variances, 1e-12))
    probability = disc_probability(float(large), float(small), tool.lateral_mm)
    if tool.axial_mm is not None:
        sigma = math.sqrt(max(float(direction @ covariance @ direction), 1e-12))
        probability *= math.erf(tool.axial_mm / sigma / math.sqrt(2.0))
    if tool.angle_rad is not None and sigma_axis_rad > 0:
        # the length of two equal normal components is Rayleigh distributed
        probability *= -math.expm1(-0.5 * (tool.angle_rad / sigma_axis_rad) ** 2)
    return min(max(probability, 0.0), 1.0)


def disc_probability(sigma_x: float, sigma_y: float, radius: float) -> float:
    """Share of a centred normal distribution with two independent components within a disc.

    Args:
        sigma_x: 1 sigma of the first component, > 0.
        sigma_y: 1 sigma of the second, > 0.
        radius: Of the disc, same unit.
    """
    narrow, wide = sorted((sigma_x, sigma_y))
    # x = radius sin(angle) takes the square root's steep end out of the integrand, and beyond
    # 10 sigma there is nothing: a wide disc must not make the nodes miss the middle
    reach = math.asin(min(1.0, 10.0 * narrow / radius))
    angle = 0.5 * reach * (1.0 + _NODES)
    x, half = radius * np.sin(angle), radius * np.cos(angle)
    density = np.exp(-0.5 * np.square(x / narrow)) / (narrow * math.sqrt(2.0 * math.pi))
    slices = density * half * erf(half / (wide * math.sqrt(2.0)))
    return float(reach * (_NODE_WEIGHTS @ slices))  # both halves of the disc
