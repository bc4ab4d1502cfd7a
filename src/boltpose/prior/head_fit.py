"""The axis of a bolt's head from its flank, cone and face, its direction being known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError
from boltpose.geometry.primitives import tukey_weights

_SECTORS = 24
_RIDGE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadFitConfig:
    """Fit of a head's axis to oriented points."""

    radius_range_mm: tuple[float, float] = (2.2, 10.0)
    """Half the spanner size (or head diameter) of M3 to M12 heads."""
    start_radii_mm: tuple[float, ...] = (3.5, 4.75, 6.5)
    """M4, M5/M6 and M8 heads; the fit reaches about 1.5 mm to either side."""
    start_shift_mm: float = 1.5
    """Starts are also tried this far to four sides: a cluster seen from one side is off."""
    cutoffs_mm: tuple[float, ...] = (1.5, 1.0, 0.6, 0.4, 0.4, 0.4, 0.4, 0.4)
    """Tukey cut-off of the distances, one per step; ends at eight times the scan's noise."""
    reach_mm: float = 9.0
    """Points further from the axis do not count: another part begins."""
    depth_mm: float = 9.0
    """Points further below the top of the head do not count; M8 socket heads are 8 mm high."""
    sigma_point_mm: float = 0.12
    """1 sigma of one sector-balanced point, neighbours being correlated. From reman18."""

    def __post_init__(self) -> None:
        if not 0 < self.radius_range_mm[0] < self.radius_range_mm[1]:
            raise ConfigError(f"radius_range_mm must increase from > 0: {self.radius_range_mm}")
        if not self.start_radii_mm or not self.cutoffs_mm:
            raise ConfigError("start_radii_mm and cutoffs_mm must not be empty")
        for name in ("start_shift_mm", "reach_mm", "depth_mm", "sigma_point_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HeadFit:
    """Where a head's axis passes, and how firmly that is known."""

    centre_mm: FloatArray
    """Shape (2,), across the axis."""
    radius_mm: float
    """Of the flank: half the spanner size of a hexagon."""
    support: float
    """Smallest eigenvalue of the centre's information, the radius being unknown, in points of
    weight one: high only if flank or cone is seen from directions all around."""
    sigma_mm: float
    """1 sigma of the centre in its worse direction."""


def fit_head(
    points: FloatArray, normals: FloatArray, start_mm: FloatArray, config: HeadFitConfig
) -> HeadFit:
    """Find the centre on which the outward normals around a head agree.

    A flank's point p with horizontal normal u satisfies u.(p - c) = r, on a cylinder and on each
    face of a hexagon alike; on a cone, a dome or a rounded edge the normal meets the axis:
    t.(p - c) = 0 with t perpendicular to u. Both are linear in c and r. Tukey weights drop other
    surfaces; only normals that look away from the centre count, so sockets and counterbore walls
    do not; 24 angular sectors share the weight, so the better seen side does not win.

    Args:
        points: Shape (N, 3), mm, a frame whose z is out of the head and 0 at the head's top.
        normals: Shape (N, 3), unit, outward, same frame.
        start_mm: Shape (2,), where the centre is looked for.
        config: Settings.

    Returns:
        The start's best fit by support; support 0 means that nothing was found.
    """
    height = points[:, 2]
    near = (height > -config.depth_mm) & (height < 1.0)
    near &= np.linalg.norm(points[:, :2] - start_mm, axis=1) < config.reach_mm + 2.0
    equations = _Equations.build(points[near], normals[near], config)
    best = HeadFit(centre_mm=start_mm.copy(), radius_mm=0.0, support=0.0, sigma_mm=np.inf)
    shift = config.start_shift_mm
    for offset in ((0.0, 0.0), (shift, 0.0), (-shift, 0.0), (0.0, shift), (0.0, -shift)):
        for radius in config.start_radii_mm:
            fit = equations.solve(start_mm + np.array(offset), radius)
            if fit is not None and fit.support > best.support:
                best = fit
    return best


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """Oriented points prepared for the linear system."""

    xy: FloatArray
    u: FloatArray
    t: FloatArray
    level: FloatArray
    is_flank: FloatArray
    is_cone: FloatArray
    sector: np.ndarray[tuple[int], np.dtype[np.int64]]
    config: HeadFitConfig

    @classmethod
    def build(cls, points: FloatArray, normals: FloatArray, config: HeadFitConfig) -> _Equations:
        level = np.linalg.norm(normals[:, :2], axis=1)
        u = normals[:, :2] / np.maximum(level, 1e-9)[:, None]
        turn = (np.arctan2(u[:, 1], u[:, 0]) / np.pi + 1) * (_SECTORS / 2)
        return cls(
            xy=points[:, :2],
            u=u,
            t=np.column_stack([-u[:, 1], u[:, 0]]),
            level=level,
            is_flank=(np.abs(normals[:, 2]) < 0.4).astype(np.float64),
            is_cone=((normals[:, 2] > 0.25) & (level > 0.25)).astype(np.float64),
            sector=np.floor(turn).astype(np.int64) % _SECTORS,
            config=config,
        )

    def solve(self, centre: FloatArray, radius: float) -> HeadFit | None:
        smallest, largest = self.config.radius_range_mm
        matrix = np.eye(3)
        for cutoff in self.config.cutoffs_mm:
            flank, cone = self._weights(centre, radius, cutoff)
            rows_u = np.column_stack([self.u, np.ones(len(self.u))])
            rows_t = np.column_stack([self.t, np.zeros(len(self.t))])
            matrix = np.einsum("ni,n,nj->ij", rows_u, flank, rows_u)
            matrix += np.einsum("ni,n,nj->ij", rows_t, cone, rows_t) + _RIDGE * np.eye(3)
            right = rows_u.T @ (flank * np.einsum("ni,ni->n", self.xy, self.u))
            right += rows_t.T @ (cone * np.einsum("ni,ni->n", self.xy, self.t))
            right += _RIDGE * np.array([centre[0], centre[1], radius])
            solution = np.linalg.solve(matrix, right)
            centre, radius = solution[:2], float(solution[2])
            if not smallest <= radius <= largest:
                return None
        coupling = matrix[:2, 2]
        information = matrix[:2, :2] - np.outer(coupling, coupling) / matrix[2, 2]
        support = float(np.linalg.eigvalsh(information)[0])
        if not support > 0:
            return None
        return HeadFit(
            centre_mm=centre,
            radius_mm=radius,
            support=support,
            sigma_mm=self.config.sigma_point_mm / support**0.5,
        )

    def _weights(
        self, centre: FloatArray, radius: float, cutoff: float
    ) -> tuple[FloatArray, FloatArray]:
        arm = self.xy - centre
        distance = np.linalg.norm(arm, axis=1)
        along = np.einsum("ni,ni->n", arm, self.u)
        beside = np.einsum("ni,ni->n", arm, self.t)
        outward = (along > 0.5 * distance).astype(np.float64)
        # a hexagon's face ends at 0.58 r from its middle
        on_face = outward * (np.abs(beside) < 0.75 * radius)
        flank = self.is_flank * on_face * tukey_weights(along - radius, cutoff)
        cone = self.is_cone * outward * tukey_weights(beside, 2 * cutoff)
        cone *= (distance > 1.5) & (distance < self.config.reach_mm)
        # the direction of a nearly vertical normal is uncertain
        cone *= 0.5 * np.minimum(1.0, 1.2 * self.level) ** 2
        total = np.bincount(self.sector, flank + cone, _SECTORS)
        seen = total > 0.5
        if not seen.any():
            return flank, cone
        share = np.minimum(np.median(total[seen]) / np.maximum(total, 1.0), 1.5)[self.sector]
        return flank * share, cone * share
