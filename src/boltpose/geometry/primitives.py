"""Robust fits of circles and cylinders to points whose outward normals are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import DegenerateGeometryError, ShapeError

_TUKEY_TO_SIGMA = 4.685
"""Tukey's constant: 95 % efficiency on Gaussian noise."""


def tukey_weights(residuals: FloatArray, cutoff: float) -> FloatArray:
    """Tukey's bisquare weights: 1 at zero, 0 from `cutoff` on; same shape as `residuals`."""
    scaled = np.clip(np.abs(residuals) / cutoff, 0.0, 1.0)
    inside = 1.0 - scaled * scaled
    return inside * inside


def robust_sigma(residuals: FloatArray) -> float:
    """1 sigma from the median absolute value; the residuals are meant to be centred on zero."""
    return 1.4826 * float(np.median(np.abs(residuals)))


def plane_basis(axis: npt.ArrayLike) -> FloatArray:
    """Two unit vectors, rows of a (2, 3) array, that complete `axis` to a right-handed frame."""
    direction = np.asarray(axis, dtype=np.float64)
    cross = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    first: FloatArray = np.asarray(cross / np.linalg.norm(cross), dtype=np.float64)
    return np.stack([first, np.asarray(np.cross(direction, first), dtype=np.float64)])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CircleFit:
    """A circle in a plane, found among outliers."""

    centre_mm: FloatArray
    """Shape (2,)."""
    radius_mm: float
    inliers: BoolArray
    """Shape (N,), points within the tolerance whose normals point away from the centre."""


def fit_circle(
    points: npt.ArrayLike,
    normals: npt.ArrayLike,
    *,
    rng: np.random.Generator,
    radius_range_mm: tuple[float, float],
    tolerance_mm: float = 0.5,
    iterations: int = 500,
    sample_size: int = 2000,
) -> CircleFit:
    """Find the circle that most points lie on with normals pointing away from its centre.

    Two points with their normals make a hypothesis (the normals meet in the centre); the best
    one is refined by Tukey-weighted least squares on the distance to the circle.

    Args:
        points: Shape (N, 2), N >= 3, mm.
        normals: Shape (N, 2), unit, outward.
        rng: Draws the pairs and, from long lists, the points that score them.
        radius_range_mm: Smallest and largest radius allowed.
        tolerance_mm: A point this near the circle supports it.
        iterations: Number of pairs drawn.
        sample_size: At most so many points score the hypotheses.

    Raises:
        ShapeError: The shapes are not (N >= 3, 2) both.
        DegenerateGeometryError: No pair makes a circle of such a radius, or its points cover so
            short an arc that the centre is free to slide.

    Source:
        Fischler and Bolles, Comm. ACM 24(6), 1981; two oriented points instead of three points.
    """
    cloud = np.asarray(points, dtype=np.float64)
    outward = np.asarray(normals, dtype=np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 2 or len(cloud) < 3 or outward.shape != cloud.shape:
        raise ShapeError(
            f"points and normals must have the same shape (N >= 3, 2), "
            f"got {cloud.shape} and {outward.shape}"
        )
    first, second = rng.integers(len(cloud), size=(2, iterations))
    cross = _cross(outward[first], outward[second])
    usable = np.abs(cross) > 0.2  # nearly parallel normals meet anywhere
    first, second, cross = first[usable], second[usable], cross[usable]
    # p1 - r1 n1 = p2 - r2 n2
    difference = cloud[first] - cloud[second]
    reach_1 = _cross(difference, outward[second]) / cross
    reach_2 = _cross(difference, outward[first]) / cross
    radius = (reach_1 + reach_2) / 2
    usable = (np.abs(reach_1 - reach_2) < 2 * tolerance_mm) & (
        (radius >= radius_range_mm[0]) & (radius <= radius_range_mm[1])
    )
    if not usable.any():
        raise DegenerateGeometryError(
            f"no two of {len(cloud)} points with their normals make a circle of radius "
            f"{radius_range_mm[0]:g} to {radius_range_mm[1]:g} mm"
        )
    centres = (cloud[first] - radius[:, None] * outward[first])[usable]
    radii = radius[usable]
    step = max(1, len(cloud) // sample_size)
    scored, scored_normals = cloud[::step], outward[::step]
    scores = [
        int(_on_circle(scored, scored_normals, centre, size, tolerance_mm).sum())
        for centre, size in zip(centres, radii, strict=True)
    ]
    best = int(np.argmax(scores))
    centre, size = _refine_circle(cloud, outward, centres[best], radii[best], tolerance_mm)
    if not radius_range_mm[0] <= size <= radius_range_mm[1]:
        raise DegenerateGeometryError(f"the best circle grew to radius {size:.1f} mm on refinement")
    inliers = _on_circle(cloud, outward, centre, size, tolerance_mm)
    return CircleFit(centre_mm=centre, radius_mm=size, inliers=inliers)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _on_circle(
    points: FloatArray, normals: FloatArray, centre: FloatArray, radius: float, tolerance: float
) -> BoolArray:
    arm = points - centre
    distance = np.sqrt(np.einsum("ni,ni->n", arm, arm))
    facing = np.einsum("ni,ni->n", arm, normals)
    return (np.abs(distance - radius) < tolerance) & (facing > 0.9 * distance)


def _refine_circle(
    points: FloatArray, normals: FloatArray, centre: FloatArray, radius: float, tolerance: float
) -> tuple[FloatArray, float]:
    for _ in range(15):
        near = _on_circle(points, normals, centre, radius, 2 * tolerance)
        arm = points[near] - centre
        distance = np.linalg.norm(arm, axis=1)
        residual = distance - radius
        weight = tukey_weights(residual, 2 * tolerance)
        rows = np.column_stack([-arm / distance[:, None], -np.ones(len(arm))])
        matrix = np.einsum("ni,n,nj->ij", rows, weight, rows)
        if near.sum() < 3 or np.linalg.cond(matrix) > 1e6:
            raise DegenerateGeometryError(
                f"{int(near.sum())} points on the circle do not fix its centre"
            )
        step = np.linalg.solve(matrix, -np.einsum("ni,n,n->i", rows, weight, residual))
        centre = centre + step[:2]
        radius = float(radius + step[2])
        if np.abs(step).max() < 1e-9:
            break
    return centre, radius


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CylinderFit:
    """A cylinder near points, refined by least squares."""

    axis: FloatArray
    """Shape (3,), unit."""
    centre_mm: FloatArray
    """Shape (3,), the point of the axis nearest to the mean of the points used."""
    radius_mm: float
    sigma_mm: float
    """Robust 1 sigma of the distances to the surface."""
    axis_sigma_rad: float
    """1 sigma of the axis direction, for independent residuals."""
    inlier_count: int
    weight_sum: float
    """Sum of the Tukey weights: of two fits to the same points the larger is the better one."""


def refine_cylinder(
    points: FloatArray,
    normals: FloatArray,
    axis: FloatArray,
    centre_mm: FloatArray,
    radius_mm: float,
    *,
    tolerances_mm: tuple[float, ...] = (1.0, 0.4, 0.25),
    iterations: int = 60,
) -> CylinderFit:
    """Move a cylinder onto the points around it by Tukey-weighted Gauss-Newton steps.

    Args:
        points: Shape (N, 3), mm, any frame.
        normals: Shape (N, 3), unit, outward.
        axis: Shape (3,), unit, a first guess within a few degrees.
        centre_mm: Shape (3,), mm, a point near the axis.
        radius_mm: First guess.
        tolerances_mm: Points further from the surface do not count; one round of steps each.
        iterations: Most steps per round.

    Raises:
        DegenerateGeometryError: The points near the cylinder do not fix it.
    """
    direction, centre, radius = np.array(axis), np.array(centre_mm), float(radius_mm)
    system = None
    for tolerance in tolerances_mm:
        for _ in range(iterations):
            system = _CylinderSystem.build(points, normals, direction, centre, radius, tolerance)
            step = system.solve()
            basis = plane_basis(direction)
            centre = centre + system.middle_mm * direction + step[:2] @ basis
            direction = direction + step[2:4] @ basis
            direction /= np.linalg.norm(direction)
            radius = float(radius + step[4])
            if np.abs(step[[0, 1, 4]]).max() < 1e-7 and np.abs(step[2:4]).max() < 1e-10:
                break
    if system is None:
        raise DegenerateGeometryError("tolerances_mm must name at least one round")
    return CylinderFit(
        axis=direction,
        centre_mm=centre,
        radius_mm=radius,
        sigma_mm=robust_sigma(system.residuals),
        axis_sigma_rad=system.axis_sigma_rad(),
        inlier_count=len(system.residuals),
        weight_sum=float(system.weights.sum()),
    )


_ROW_SCALE = np.array([1.0, 1.0, 1e-2, 1e-2, 1.0])
"""Brings mm and rad (times heights of about 100 mm) of the unknowns to one size."""


@dataclass(frozen=True, slots=True, eq=False)
class _CylinderSystem:
    """Linearised distances to a cylinder; unknowns: 2 shifts, 2 turns, the radius."""

    rows: FloatArray
    residuals: FloatArray
    weights: FloatArray
    blocks: FloatArray
    """Patch number of each row, for the jackknife."""
    middle_mm: float

    @classmethod
    def build(
        cls,
        points: FloatArray,
        normals: FloatArray,
        direction: FloatArray,
        centre: FloatArray,
        radius: float,
        tolerance: float,
    ) -> _CylinderSystem:
        basis = plane_basis(direction)
        relative = points - centre
        arm = relative @ basis.T
        distance = np.linalg.norm(arm, axis=1)
        outward = np.einsum("ni,ni->n", arm, normals @ basis.T)
        near = (np.abs(distance - radius) < tolerance) & (outward > 0.9 * distance)
        if near.sum() < 20:
            raise DegenerateGeometryError(f"only {int(near.sum())} points on the cylinder")
        unit = arm[near] / distance[near, None]
        height = relative[near] @ direction
        middle = float(height.mean())
        rows = np.column_stack([-unit, -unit * (height - middle)[:, None], -np.ones(len(unit))])
        residuals = distance[near] - radius
        sector = np.floor((np.arctan2(unit[:, 1], unit[:, 0]) / np.pi + 1) * 6) % 12
        third = np.clip((height - height.min()) / max(np.ptp(height), 1e-9) * 3, 0, 2.999)
        return cls(
            rows=rows * _ROW_SCALE,
            residuals=residuals,
            weights=tukey_weights(residuals, tolerance),
            blocks=sector * 3 + np.floor(third),
            middle_mm=middle,
        )

    def solve(self, keep: BoolArray | None = None) -> FloatArray:
        weights = self.weights if keep is None else self.weights * keep
        matrix = np.einsum("ni,n,nj->ij", self.rows, weights, self.rows)
        if np.linalg.cond(matrix) > 1e8:
            raise DegenerateGeometryError(
                f"{int((weights > 0).sum())} points on the cylinder do not fix its axis"
            )
        right = -np.einsum("ni,n,n->i", self.rows, weights, self.residuals)
        return _ROW_SCALE * np.linalg.solve(matrix, right)

    def axis_sigma_rad(self) -> float:
        """1 sigma of the direction by leaving out one of 36 surface patches at a time.

        Dents, ovality and strips of the scan are errors shared by neighbours: counting points
        as independent would claim an accuracy ten times too good.
        """
        names = np.unique(self.blocks)
        turns = np.stack([self.solve(self.blocks != name)[2:4] for name in names])
        spread = turns - turns.mean(axis=0)
        covariance = (len(names) - 1) / len(names) * spread.T @ spread
        return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
