"""The main housing's axis: Gauss-sphere plane by RANSAC, then a cylinder refined on the points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, DegenerateGeometryError
from boltpose.geometry.primitives import (
    CylinderFit,
    fit_circle,
    plane_basis,
    refine_cylinder,
    robust_sigma,
    tukey_weights,
)
from boltpose.geometry.transforms import angle_between_rad

_TOLERANCE_STEPS = (4.0, 1.6, 1.0)
"""Rounds of the cylinder's refinement; starting narrow locks onto a step of the housing."""

_START_TILT_RAD = 5e-3
"""0.3 deg: what a dent or a label error in a third of the surface turns the axis by."""

_RIVAL_SHARE = 0.02
"""An optimum that explains 2 % less of the surface has a third of the say."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HousingAxisConfig:
    """How the main housing's axis is found and when it counts as undetermined."""

    plane_tolerance: float = 0.05
    """Sine of the angle by which a normal may leave the Gauss-sphere plane and still support it.
    Ten times the paper's 0.005: normals of a 1 mm scan with 0.05 mm noise scatter by 0.02."""
    ransac_iterations: int = 1000
    """Pairs of normals tried; the paper's number."""
    min_inlier_ratio: float = 0.25
    """Share of housing normals on the plane. A sphere gives `plane_tolerance`."""
    max_runner_up: float = 0.7
    """Best support of a clearly different axis, relative to the best one's."""
    max_axis_sigma_rad: float = 0.01
    """Above this uncertainty (0.6 deg) the axis counts as undetermined."""
    radius_range_mm: tuple[float, float] = (10.0, 120.0)
    """Housing radii accepted: starters of cars and lorries, with room."""
    cylinder_tolerance_mm: float = 0.25
    """Points this near the main cylinder refine the axis: five times the scan's noise; leaves out
    grooves, dents, steps and plates."""
    axis_sigma_floor_rad: float = 7e-4
    """Error of the axis that the housing's surface cannot show (0.04 deg): the housing itself is
    warped. From the spread of true errors over reman18, which is simulated."""
    sample_size: int = 4000
    """Normals that score the RANSAC hypotheses."""

    def __post_init__(self) -> None:
        for name in ("plane_tolerance", "min_inlier_ratio", "max_runner_up"):
            value = getattr(self, name)
            if not 0 < value < 1:
                raise ConfigError(f"{name} must be between 0 and 1, got {value}")
        for name in ("max_axis_sigma_rad", "cylinder_tolerance_mm", "axis_sigma_floor_rad"):
            value = getattr(self, name)
            if not value > 0:
                raise ConfigError(f"{name} must be > 0, got {value}")
        if not 0 < self.radius_range_mm[0] < self.radius_range_mm[1]:
            raise ConfigError(f"radius_range_mm must increase from > 0, got {self.radius_range_mm}")
        if self.ransac_iterations < 1 or self.sample_size < 10:
            raise ConfigError("ransac_iterations must be >= 1 and sample_size >= 10")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HousingAxis:
    """Line in the middle of the main housing; its sign is arbitrary."""

    direction: FloatArray
    """Shape (3,), unit."""
    point_mm: FloatArray
    """Shape (3,), mm, on the line."""
    radius_mm: float
    spread_rad: float
    """Robust 1 sigma of the normals against the plane perpendicular to the axis."""
    sigma_rad: float
    """1 sigma of the direction."""
    normal_count: int
    inlier_ratio: float


def find_housing_axis(
    points: FloatArray, normals: FloatArray, config: HousingAxisConfig, rng: np.random.Generator
) -> HousingAxis:
    """Find the axis all housing normals are perpendicular to, and the cylinder around it.

    Args:
        points: Shape (N, 3), mm, the housing's points, any frame.
        normals: Shape (N, 3), unit, outward.
        config: Settings.
        rng: Draws pairs of normals and of points.

    Raises:
        DegenerateGeometryError: The normals do not determine an axis: too few on any plane, as
            on a sphere; several axes fit as well, as on a plate or a cube; or no cylinder.

    Source:
        Paper, section 3.5 (plane through the normals by RANSAC). Ours: the plane passes through
        the sphere's centre, so two normals make a hypothesis; the axis is then refined on the
        cylinder's points, which halves its error (dents and seams turn normals more than they
        move points).
    """
    direction = _gauss_plane(normals, config, rng)
    leaving = normals @ direction
    near = np.abs(leaving) < 2 * config.plane_tolerance
    spread = robust_sigma(leaving[near])
    on_plane = np.abs(leaving) < config.plane_tolerance
    cylinder = _main_cylinder(points[near], normals[near], direction, config, rng)
    turned = float(np.abs(np.sin(angle_between_rad(cylinder.axis, direction))))
    if turned > config.plane_tolerance:
        raise DegenerateGeometryError(
            f"the housing's normals and its cylinder disagree about the axis by "
            f"{np.rad2deg(np.arcsin(turned)):.1f} deg"
        )
    return HousingAxis(
        direction=cylinder.axis,
        point_mm=cylinder.centre_mm,
        radius_mm=cylinder.radius_mm,
        spread_rad=float(np.arcsin(min(spread, 1.0))),
        sigma_rad=float(np.hypot(cylinder.axis_sigma_rad, config.axis_sigma_floor_rad)),
        normal_count=int(on_plane.sum()),
        inlier_ratio=float(on_plane.mean()),
    )


def _gauss_plane(
    normals: FloatArray, config: HousingAxisConfig, rng: np.random.Generator
) -> FloatArray:
    sample = normals[:: max(1, len(normals) // config.sample_size)]
    first, second = rng.integers(len(sample), size=(2, config.ransac_iterations))
    axes = np.cross(sample[first], sample[second])
    length = np.linalg.norm(axes, axis=1)
    axes = axes[length > 0.2] / length[length > 0.2, None]
    if len(axes) == 0:
        raise DegenerateGeometryError(
            "all normals of the main housing are parallel: they do not determine its axis"
        )
    support = (np.abs(sample @ axes.T) < config.plane_tolerance).mean(axis=0)
    best = int(np.argmax(support))
    if support[best] < config.min_inlier_ratio:
        raise DegenerateGeometryError(
            f"only {support[best]:.0%} of the main housing's normals lie in a common plane, "
            f"wanted {config.min_inlier_ratio:.0%}: they do not determine its axis"
        )
    different = np.abs(axes @ axes[best]) < np.cos(np.deg2rad(30))
    runner_up = float(support[different].max()) if different.any() else 0.0
    if runner_up > config.max_runner_up * support[best]:
        raise DegenerateGeometryError(
            f"two different axes fit the main housing's normals ({support[best]:.0%} and "
            f"{runner_up:.0%} of them): they do not determine its axis"
        )
    direction = axes[best]
    for _ in range(20):
        leaving = normals @ direction
        near = np.abs(leaving) < 2 * config.plane_tolerance
        sigma = robust_sigma(leaving[near])
        weight = tukey_weights(leaving, float(np.clip(4.7 * sigma, 0.01, 0.15)))
        scatter = np.einsum("ni,n,nj->ij", normals, weight, normals)
        direction = np.linalg.eigh(scatter)[1][:, 0]
    return direction


def _main_cylinder(
    points: FloatArray,
    normals: FloatArray,
    direction: FloatArray,
    config: HousingAxisConfig,
    rng: np.random.Generator,
) -> CylinderFit:
    basis = plane_basis(direction)
    flat = normals @ basis.T
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    circle = fit_circle(
        points @ basis.T,
        flat,
        rng=rng,
        radius_range_mm=config.radius_range_mm,
        tolerance_mm=3 * config.cylinder_tolerance_mm,
    )
    height = float(np.median(points @ direction))
    centre = circle.centre_mm @ basis + height * direction
    cylinder = _agreed_cylinder(points, normals, direction, centre, circle.radius_mm, config)
    if not cylinder.axis_sigma_rad <= config.max_axis_sigma_rad:
        raise DegenerateGeometryError(
            f"the main housing's cylinder leaves its axis uncertain by "
            f"{np.rad2deg(cylinder.axis_sigma_rad):.2f} deg, wanted at most "
            f"{np.rad2deg(config.max_axis_sigma_rad):.2f}"
        )
    return cylinder


def _agreed_cylinder(
    points: FloatArray,
    normals: FloatArray,
    direction: FloatArray,
    centre: FloatArray,
    radius: float,
    config: HousingAxisConfig,
) -> CylinderFit:
    """Refine from several tilts; where dents or wrong labels make rival optima, take their mean.

    The rivals' spread enters the sigma: the surface does not tell which of them is right.
    """
    step = max(1, len(points) // (2 * config.sample_size))
    sample, outward = points[::step], normals[::step]
    tolerances = tuple(step * config.cylinder_tolerance_mm for step in _TOLERANCE_STEPS)
    first = refine_cylinder(sample, outward, direction, centre, radius, tolerances_mm=tolerances)
    fits = [first]
    basis = plane_basis(first.axis)
    for tilt in (basis[0], -basis[0], basis[1], -basis[1]):
        axis = first.axis + _START_TILT_RAD * tilt
        axis /= np.linalg.norm(axis)
        fits.append(
            refine_cylinder(
                sample,
                outward,
                axis,
                first.centre_mm,
                first.radius_mm,
                tolerances_mm=tolerances[-1:],
            )
        )
    weight = np.array([fit.weight_sum for fit in fits])
    share = np.exp((weight / weight.max() - 1.0) / _RIVAL_SHARE)
    # several starts in one optimum count once
    axes = np.stack([fit.axis for fit in fits])
    alike = np.linalg.norm(axes[:, None] - axes[None], axis=2) < 0.1 * _START_TILT_RAD
    share /= alike.sum(axis=1)
    share /= share.sum()
    mean = share @ axes
    mean /= np.linalg.norm(mean)
    spread = float(np.sqrt(share @ np.sum((axes - mean) ** 2, axis=1)))
    best = fits[int(np.argmax(weight))]
    centres = np.stack([fit.centre_mm for fit in fits])
    return replace(
        best,
        axis=mean,
        centre_mm=share @ centres,
        axis_sigma_rad=float(np.hypot(best.axis_sigma_rad, spread)),
    )
