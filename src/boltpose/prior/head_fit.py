"""The axis of a bolt's head from its flank, cone and face, its direction being known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import BoolArray, FloatArray
from boltpose.errors import ConfigError
from boltpose.geometry.primitives import tukey_weights
from boltpose.prior.hexagon_fit import fit_hexagon

_SECTORS = 24
_OCTANTS = 8
_RIDGE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadFitConfig:
    """Fit of a head's axis to oriented points."""

    radius_range_mm: tuple[float, float] = (2.2, 9.0)
    """Half the spanner size (or head diameter) of M3 to M10 heads."""
    start_radii_mm: tuple[float, ...] = (3.0, 4.0, 5.0, 6.5)
    """M3 to M8 heads; the fit reaches about 1.5 mm to either side."""
    start_shift_mm: float = 1.5
    """Starts are also tried this far to four sides: a cluster seen from one side is off."""
    cutoffs_mm: tuple[float, ...] = (1.5, 1.0, 0.6, 0.4, 0.4, 0.4, 0.4, 0.4)
    """Tukey cut-off of the distances, one per step; ends at eight times the scan's noise."""
    depth_mm: tuple[float, float] = (2.5, 4.5)
    """Below the top of the head points count fully down to the first, no more from the second
    depth on: heads are 3 to 8 mm high, and a boss under the head is round too."""
    final_cutoff_mm: float = 0.3
    """Tukey cut-off of the choice between a round and a hexagonal flank and of the latter's fit."""
    min_hexagon_gain: float = 0.1
    """So much more of the flank's weight must lie on six faces than on a cylinder. On reman18
    (simulated) hexagons gain 0.15 to 0.5, round heads lose 0.05 to 0.4."""
    min_support: float = 0.5
    """Half a point's worth of information about the centre: below it nothing round was there."""
    rival_share: float = 0.7
    """Another optimum with this share of the best one's score is a rival: which of the two is the
    head cannot be told. Fits that end in the same optimum differ by a tenth."""
    max_face_offset_mm: float = 0.8
    """1 sigma by which the middle of the seen top face may lie off the axis, for half-seen faces;
    ranks the starts only."""

    def __post_init__(self) -> None:
        for name in ("radius_range_mm", "depth_mm"):
            low, high = getattr(self, name)
            if not 0 < low < high:
                raise ConfigError(f"{name} must increase from > 0, got {low}, {high}")
        if not self.start_radii_mm or not self.cutoffs_mm:
            raise ConfigError("start_radii_mm and cutoffs_mm must not be empty")
        for name in ("start_shift_mm", "final_cutoff_mm", "min_support", "max_face_offset_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if not 0 < self.rival_share <= 1:
            raise ConfigError(f"rival_share must be in (0, 1], got {self.rival_share}")


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
    """1 sigma of the centre in its worse direction, from leaving out an eighth of the turn."""
    score: float
    """Support, lowered where the face does not sit in the middle; ranks fits of one head."""
    face_offset_mm: float
    """From the centre to the middle of the top face's points."""
    rival_mm: float
    """From the centre to the farthest rival optimum of the same head; 0 if all starts agree."""
    is_hexagon: bool
    """The flank has six faces; else it is taken for round."""


def fit_head(
    points: FloatArray, normals: FloatArray, start_mm: FloatArray, config: HeadFitConfig
) -> HeadFit | None:
    """Find the centre on which the outward normals around a head agree.

    A flank's point p with horizontal normal u satisfies u.(p - c) = r, on a cylinder and on each
    face of a hexagon alike; on a cone, a dome or a rounded edge the normal meets the axis:
    t.(p - c) = 0 with t perpendicular to u. Both are linear in c and r. Tukey weights drop other
    surfaces; only normals that look away from the centre count, so sockets and counterbore walls
    do not; 24 angular sectors share the weight, so the better seen side does not win. A flank of
    six faces is then fitted as such, which is five times as accurate.

    Args:
        points: Shape (N, 3), mm, a frame whose z is out of the head and 0 at the head's top.
        normals: Shape (N, 3), unit, outward, same frame.
        start_mm: Shape (2,), where the centre is looked for.
        config: Settings.

    A hexagonal flank is then fitted once more as six faces, which is five times as accurate.

    Returns:
        The best fit of several starts, or None if no start ends in a head of possible size.
    """
    reach = config.radius_range_mm[1] + 1.0
    near = (points[:, 2] > -config.depth_mm[1]) & (points[:, 2] < 0.5)
    near &= np.linalg.norm(points[:, :2] - start_mm, axis=1) < reach
    if near.sum() < 10:
        return None
    equations = _Equations(points[near], normals[near], config)
    shift = config.start_shift_mm
    offsets = np.array([(0.0, 0.0), (shift, 0.0), (-shift, 0.0), (0.0, shift), (0.0, -shift)])
    centres = np.repeat(start_mm + offsets, len(config.start_radii_mm), axis=0)
    radii = np.tile(np.array(config.start_radii_mm), len(offsets))
    return equations.best_fit(centres, radii)


class _Equations:
    """Oriented points prepared for the linear system, solved for all starts at once."""

    def __init__(self, points: FloatArray, normals: FloatArray, config: HeadFitConfig) -> None:
        self._config = config
        self._xy = points[:, :2]
        level = np.linalg.norm(normals[:, :2], axis=1)
        self._u = normals[:, :2] / np.maximum(level, 1e-9)[:, None]
        self._t = np.column_stack([-self._u[:, 1], self._u[:, 0]])
        fade = config.depth_mm[1] - config.depth_mm[0]
        depth_weight = np.clip((points[:, 2] + config.depth_mm[1]) / fade, 0.0, 1.0)
        self._flank = depth_weight * (np.abs(normals[:, 2]) < 0.4)
        # the direction of a nearly vertical normal is uncertain
        self._cone = depth_weight * 0.5 * np.minimum(1.0, 1.2 * level) ** 2
        self._cone *= (normals[:, 2] > 0.25) & (level > 0.25)
        turn = (np.arctan2(self._u[:, 1], self._u[:, 0]) / np.pi + 1) * (_SECTORS / 2)
        self._sector = np.floor(turn).astype(np.int64) % _SECTORS
        self._in_sector = np.eye(_SECTORS)[self._sector]
        self._face = self._xy[(normals[:, 2] > 0.8) & (points[:, 2] > -0.6)]
        rows_u = np.column_stack([self._u, np.ones(len(level))])
        rows_t = np.column_stack([self._t, np.zeros(len(level))])
        self._products_u = (rows_u[:, :, None] * rows_u[:, None]).reshape(-1, 9)
        self._products_t = (rows_t[:, :, None] * rows_t[:, None]).reshape(-1, 9)
        self._right_u = rows_u * np.einsum("ni,ni->n", self._xy, self._u)[:, None]
        self._right_t = rows_t * np.einsum("ni,ni->n", self._xy, self._t)[:, None]

    def best_fit(self, centres: FloatArray, radii: FloatArray) -> HeadFit | None:
        smallest, largest = self._config.radius_range_mm
        flank = cone = np.zeros((len(radii), len(self._xy)))
        matrix = np.zeros((len(radii), 3, 3))
        for cutoff in self._config.cutoffs_mm:
            flank, cone = self._weights(centres, radii, cutoff)
            previous = np.column_stack([centres, radii])
            matrix, solution = self._solve(flank, cone, previous)
            centres, radii = solution[:, :2], np.clip(solution[:, 2], smallest, largest)
        support = _information(matrix)
        offset = self._face_offset(centres, radii)
        score = support * np.exp(-0.5 * (offset / self._config.max_face_offset_mm) ** 2)
        score[(radii <= smallest) | (radii >= largest)] = 0.0
        score[support < self._config.min_support] = 0.0
        best = int(np.argmax(score))
        if not score[best] > 0:
            return None
        fit = HeadFit(
            centre_mm=centres[best],
            radius_mm=float(radii[best]),
            support=float(support[best]),
            sigma_mm=self._jackknife(flank[best], cone[best], centres[best], float(radii[best])),
            score=float(score[best]),
            face_offset_mm=float(offset[best]),
            rival_mm=self._rival_distance(centres, radii, score, best),
            is_hexagon=False,
        )
        return self._as_hexagon(fit) or fit

    def _rival_distance(
        self, centres: FloatArray, radii: FloatArray, score: FloatArray, best: int
    ) -> float:
        distance = np.linalg.norm(centres - centres[best], axis=1)
        # farther away it is another head
        is_rival = (score >= self._config.rival_share * score[best]) & (distance < radii[best])
        return float(distance[is_rival].max())

    def _as_hexagon(self, fit: HeadFit) -> HeadFit | None:
        """Fit six faces to the flank of a round fit; None where a cylinder explains it better."""
        arm = self._xy - fit.centre_mm
        distance = np.linalg.norm(arm, axis=1)
        along = np.einsum("ni,ni->n", arm, self._u)
        flank = self._flank * (along > 0.5 * distance)
        # from a face's middle to a corner the distance grows by 0.15 r
        flank = flank * (np.abs(along - fit.radius_mm) < 1.2)
        flank = flank * (distance < 1.3 * fit.radius_mm + 0.5)
        weight = float(flank.sum())
        if not weight > 0:
            return None
        cutoff = self._config.final_cutoff_mm
        hexagon = fit_hexagon(self._xy, self._u, flank, fit.centre_mm, fit.radius_mm, cutoff)
        smallest, largest = self._config.radius_range_mm
        if hexagon is None or not smallest < hexagon.radius_mm < largest:
            return None
        middle = float(np.median(distance[flank > 0]))
        explained = float((flank * tukey_weights(distance - middle, cutoff)).sum()) / weight
        if hexagon.explained < explained + self._config.min_hexagon_gain:
            return None
        return replace(
            fit,
            centre_mm=hexagon.centre_mm,
            radius_mm=hexagon.radius_mm,
            support=hexagon.support,
            sigma_mm=hexagon.sigma_mm,
            # six faces that explain the flank better than any cylinder settle which optimum it is
            rival_mm=0.0,
            is_hexagon=True,
        )

    def _weights(
        self, centres: FloatArray, radii: FloatArray, cutoff: float
    ) -> tuple[FloatArray, FloatArray]:
        arm = self._xy - centres[:, None]
        distance = np.linalg.norm(arm, axis=2)
        along = np.einsum("sni,ni->sn", arm, self._u)
        beside = np.einsum("sni,ni->sn", arm, self._t)
        size = radii[:, None]
        outward: BoolArray = along > 0.5 * distance
        # a hexagon's face ends at 0.58 r from its middle; a flange is at most 1.5 r wide
        on_face = outward & (np.abs(beside) < 0.75 * size)
        on_cone = outward & (distance > 1.5) & (distance < 1.5 * size + 0.5)
        flank = self._flank * on_face * tukey_weights(along - size, cutoff)
        cone = self._cone * on_cone * tukey_weights(beside, 2 * cutoff)
        total = (flank + cone) @ self._in_sector
        seen = np.where(total > 0.5, total, np.nan)
        some = (total > 0.5).any(axis=1)
        typical = np.ones(len(radii))
        typical[some] = np.nanmedian(seen[some], axis=1)
        share = np.minimum(typical[:, None] / np.maximum(total, 1.0), 1.5)[:, self._sector]
        return flank * share, cone * share

    def _solve(
        self, flank: FloatArray, cone: FloatArray, previous: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        matrix = (flank @ self._products_u + cone @ self._products_t).reshape(-1, 3, 3)
        right = flank @ self._right_u + cone @ self._right_t
        matrix = matrix + _RIDGE * np.eye(3)
        solution = np.linalg.solve(matrix, (right + _RIDGE * previous)[:, :, None])
        return matrix, solution[:, :, 0]

    def _face_offset(self, centres: FloatArray, radii: FloatArray) -> FloatArray:
        arm = self._face - centres[:, None]
        inside = np.linalg.norm(arm, axis=2) < 1.2 * radii[:, None]
        middle = np.einsum("sni,sn->si", arm, inside.astype(np.float64))
        return np.linalg.norm(middle, axis=1) / np.maximum(inside.sum(axis=1), 1)

    def _jackknife(
        self, flank: FloatArray, cone: FloatArray, centre: FloatArray, radius: float
    ) -> float:
        octant = self._sector // (_SECTORS // _OCTANTS)
        keep = (octant != np.arange(_OCTANTS)[:, None]).astype(np.float64)
        previous = np.tile(np.array([centre[0], centre[1], radius]), (_OCTANTS, 1))
        _, solution = self._solve(flank * keep, cone * keep, previous)
        spread = solution[:, :2] - solution[:, :2].mean(axis=0)
        covariance = (_OCTANTS - 1) / _OCTANTS * spread.T @ spread
        return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


def _information(matrix: FloatArray) -> FloatArray:
    """Smallest eigenvalue of the centre's information once the radius is fitted too."""
    coupling = matrix[:, :2, 2]
    outer = coupling[:, :, None] * coupling[:, None] / matrix[:, 2, 2][:, None, None]
    return np.maximum(np.linalg.eigvalsh(matrix[:, :2, :2] - outer)[:, 0], 0.0)
