"""A pose of a full scan that needs no labels: its cylinders are always in the same place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from boltpose.arrays import BoolArray, FloatArray, as_points
from boltpose.errors import DegenerateGeometryError, ShapeError
from boltpose.geometry.sampling import voxel_representatives
from boltpose.geometry.transforms import Transform


@dataclass(frozen=True, slots=True, kw_only=True)
class CanonicalConfig:
    """Where the two cylinders of a starter motor are looked for; lengths describe the motor."""

    voxel_mm: float = 1.5
    """The search runs on a scan thinned to this."""
    axis_tolerance_rad: float = 0.03
    """A normal this close to the plane across the axis belongs to a wall along the axis."""
    axis_hypotheses: int = 600
    """Pairs of normals tried for the axis."""
    circle_hypotheses: int = 4000
    """Pairs of wall points tried for each circle."""
    circle_tolerance_mm: float = 0.6
    """Distance from a circle up to which a wall point supports it."""
    main_radius_mm: tuple[float, float] = (22.0, 60.0)
    """Radius of the main housing; reman18 spans 32 to 45."""
    second_radius_mm: tuple[float, float] = (14.0, 40.0)
    """Radius of the solenoid; reman18 spans 23 to 29."""
    second_offset_mm: tuple[float, float] = (35.0, 120.0)
    """Distance of the solenoid's axis from the main axis; reman18 spans 63 to 79."""
    min_axis_share: float = 0.2
    """Share of the normals that must lie across the axis, or there is no cylinder to hold on to."""
    min_main_share: float = 0.05
    """Share of all thinned points that must lie on the main cylinder; reman18 has at least 0.16."""
    min_second_share: float = 0.02
    """Share of all thinned points that must lie on the second cylinder, or there is none."""

    def __post_init__(self) -> None:
        for name in ("voxel_mm", "axis_tolerance_rad", "circle_tolerance_mm"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in ("axis_hypotheses", "circle_hypotheses"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        for name in ("main_radius_mm", "second_radius_mm", "second_offset_mm"):
            low, high = getattr(self, name)
            if not 0 < low < high:
                raise ValueError(f"{name} must be 0 < low < high, got {(low, high)}")
        for name in ("min_axis_share", "min_main_share", "min_second_share"):
            if not 0 < getattr(self, name) < 1:
                raise ValueError(f"{name} must be between 0 and 1, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CanonicalFrame:
    """Frame `canonical` of a scan and what it was taken from.

    Origin on the main cylinder's axis, half way along what lies on that axis; z along it, from
    the housing to the end that reaches further out (the drive end); y to the second cylinder.
    """

    canonical_from_prior: Transform
    main_radius_mm: float
    main_share: float
    """Share of the thinned points on the main cylinder."""
    second_radius_mm: float
    """0 if there is no second cylinder."""
    second_offset_mm: float
    """Distance between the two axes; 0 if there is no second cylinder."""
    second_share: float
    """Share of the thinned points on the second cylinder (on the best candidate, if refused)."""
    has_second_cylinder: bool
    """False: the turn about z was not determined by the scan, y is arbitrary."""
    axis_share: float
    """Share of the normals across the axis."""
    z_range_mm: tuple[float, float]
    """Ends of what lies on the main axis, frame `canonical`."""
    sign_margin_mm: float
    """How much further the drive end reaches beyond the main cylinder than the other end."""


@dataclass(frozen=True, slots=True, eq=False)
class _Circle:
    centre: FloatArray
    radius_mm: float
    on_circle: BoolArray


def find_canonical_frame(
    points_prior: npt.ArrayLike,
    normals: npt.ArrayLike,
    *,
    seed: int = 0,
    config: CanonicalConfig | None = None,
) -> CanonicalFrame:
    """Find the canonical frame of the complete scan of a starter motor, without labels.

    Args:
        points_prior: Shape (N, 3), N >= 100, mm, any frame.
        normals: Shape (N, 3), unit, outward.
        seed: Of the random hypotheses.
        config: Where to look.

    Returns:
        The frame. Look at `has_second_cylinder` before using its y axis.

    Raises:
        ShapeError: An argument has the wrong shape.
        DegenerateGeometryError: The normals share no common perpendicular, or no main cylinder
            of the expected radius is found.

    Source:
        Fischler and Bolles, Communications of the ACM 24(6), 1981 (RANSAC); the choice of
        cylinders is ours.
    """
    setting = config or CanonicalConfig()
    cloud = as_points(points_prior, "points_prior", at_least=100)
    outward = as_points(normals, "normals")
    if outward.shape != cloud.shape:
        raise ShapeError(f"normals must have shape {cloud.shape}, got {outward.shape}")
    keep = voxel_representatives(cloud, setting.voxel_mm)
    points, directions = cloud[keep], outward[keep]
    rng = np.random.default_rng(seed)

    axis, axis_share = _find_axis(directions, rng, setting)
    across = _complete_basis(axis)
    along = np.abs(directions @ axis) < 2 * setting.axis_tolerance_rad
    planar = points @ across.T
    planar_normals = directions @ across.T
    main = _find_circle(
        planar[along], planar_normals[along], setting.main_radius_mm, None, rng, setting
    )
    low, high = setting.main_radius_mm
    main_share = 0.0 if main is None else float(main.on_circle.sum()) / len(points)
    if main is None or main_share < setting.min_main_share or not low <= main.radius_mm <= high:
        raise DegenerateGeometryError(
            f"no cylinder of radius {low} to {high} mm along the common perpendicular of the "
            f"normals (best candidate: {main_share:.1%} of the points)"
        )
    second = _find_circle(
        planar[along],
        planar_normals[along],
        setting.second_radius_mm,
        main,
        rng,
        setting,
    )
    second_share = 0.0 if second is None else float(second.on_circle.sum()) / len(points)
    has_second = second is not None and second_share >= setting.min_second_share

    height = points @ axis
    from_axis = np.linalg.norm(planar - main.centre, axis=1)
    core = height[from_axis < 1.15 * main.radius_mm]
    bottom, top = (float(value) for value in np.quantile(core, (0.0005, 0.9995)))
    body_low, body_high = np.quantile(height[along][main.on_circle], (0.01, 0.99))
    margin = float((top - body_high) - (body_low - bottom))
    z_axis = axis if margin >= 0 else -axis
    origin = main.centre @ across + axis * (bottom + top) / 2
    if has_second and second is not None:
        towards = (second.centre - main.centre) @ across
        offset = float(np.linalg.norm(towards))
        y_axis = towards / offset
    else:
        offset, y_axis = 0.0, across[1]
    rotation = np.stack([np.cross(y_axis, z_axis), y_axis, z_axis])
    return CanonicalFrame(
        canonical_from_prior=Transform.from_parts(
            "canonical", "prior", rotation, -rotation @ origin
        ),
        main_radius_mm=main.radius_mm,
        main_share=main_share,
        second_radius_mm=second.radius_mm if has_second and second is not None else 0.0,
        second_offset_mm=offset,
        second_share=second_share,
        has_second_cylinder=has_second,
        axis_share=axis_share,
        z_range_mm=(-(top - bottom) / 2, (top - bottom) / 2),
        sign_margin_mm=abs(margin),
    )


def _find_axis(
    normals: FloatArray, rng: np.random.Generator, setting: CanonicalConfig
) -> tuple[FloatArray, float]:
    """Direction that most normals are perpendicular to, and the share of them."""
    first, second = rng.integers(0, len(normals), size=(2, setting.axis_hypotheses))
    candidates = np.cross(normals[first], normals[second])
    length = np.linalg.norm(candidates, axis=1)
    candidates = candidates[length > 0.3] / length[length > 0.3, None]
    if not len(candidates):
        raise DegenerateGeometryError("all normals are parallel: there is no cylinder")
    some = normals[rng.permutation(len(normals))[:4000]]
    support = (np.abs(some @ candidates.T) < setting.axis_tolerance_rad).sum(axis=0)
    axis = candidates[int(np.argmax(support))]
    for _ in range(5):
        inside = normals[np.abs(normals @ axis) < setting.axis_tolerance_rad]
        axis = np.linalg.eigh(inside.T @ inside)[1][:, 0]
    share = float((np.abs(normals @ axis) < setting.axis_tolerance_rad).mean())
    if share < setting.min_axis_share:
        raise DegenerateGeometryError(
            f"{share:.0%} of the normals share a perpendicular, wanted {setting.min_axis_share:.0%}"
        )
    return axis, share


def _complete_basis(axis: FloatArray) -> FloatArray:
    """Two unit vectors, rows of (2, 3), that make a right-handed frame with `axis` as z."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    right = np.cross(helper, axis)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(axis, right)])


def _find_circle(
    points: FloatArray,
    normals: FloatArray,
    radius_mm: tuple[float, float],
    around: _Circle | None,
    rng: np.random.Generator,
    setting: CanonicalConfig,
) -> _Circle | None:
    """Circle with the most wall points, (N, 2) mm, whose normals look out of it; None if none.

    With `around` the centre must lie at `second_offset_mm` from that circle's.
    """
    free = np.ones(len(points), dtype=np.bool_) if around is None else ~around.on_circle
    if free.sum() < 20:
        return None
    pool, pool_normals = points[free], normals[free]
    i, j = rng.integers(0, len(pool), size=(2, setting.circle_hypotheses))
    turned = pool_normals[i] - pool_normals[j]
    square = np.einsum("hi,hi->h", turned, turned)
    radius = np.einsum("hi,hi->h", pool[i] - pool[j], turned) / np.maximum(square, 1e-9)
    first = pool[i] - radius[:, None] * pool_normals[i]
    other = pool[j] - radius[:, None] * pool_normals[j]
    centre = (first + other) / 2
    good = (square > 0.1) & (radius >= radius_mm[0]) & (radius <= radius_mm[1])
    good &= np.linalg.norm(first - other, axis=1) < 4 * setting.circle_tolerance_mm
    if around is not None:
        offset = np.linalg.norm(centre - around.centre, axis=1)
        good &= (offset >= setting.second_offset_mm[0]) & (offset <= setting.second_offset_mm[1])
    if not good.any():
        return None
    centre, radius = centre[good], radius[good]
    some = rng.permutation(len(pool))[:3000]
    support = np.zeros(len(centre))
    for start in range(0, len(centre), 256):
        part = slice(start, start + 256)
        delta = pool[some][None] - centre[part, None]
        distance = np.linalg.norm(delta, axis=2)
        facing = np.einsum("hni,ni->hn", delta, pool_normals[some])
        near = np.abs(distance - radius[part, None]) < setting.circle_tolerance_mm
        support[part] = (near & (facing > 0.95 * distance)).sum(axis=1)
    best = int(np.argmax(support))
    return _refine_circle(points, normals, centre[best], float(radius[best]), setting)


def _refine_circle(
    points: FloatArray,
    normals: FloatArray,
    centre: FloatArray,
    radius: float,
    setting: CanonicalConfig,
) -> _Circle:
    """Least-squares circle through the wall points near a first guess."""
    on_circle = np.zeros(len(points), dtype=np.bool_)
    for _ in range(8):
        delta = points - centre
        distance = np.linalg.norm(delta, axis=1)
        facing = np.einsum("ni,ni->n", delta, normals)
        on_circle = np.abs(distance - radius) < setting.circle_tolerance_mm
        on_circle &= facing > 0.95 * distance
        if on_circle.sum() < 10:
            break
        unit = delta[on_circle] / distance[on_circle, None]
        design = np.column_stack([unit, np.ones(len(unit))])
        change = np.linalg.lstsq(design, distance[on_circle] - radius, rcond=None)[0]
        centre, radius = centre + change[:2], radius + float(change[2])
    return _Circle(centre=centre, radius_mm=radius, on_circle=on_circle)
