"""A hexagonal head's centre from its six faces, once the round fit has come close."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.geometry.primitives import tukey_weights

_FACE_RAD = np.pi / 3
_FACES = 6
_WIDENING = (3.0, 2.0, 1.5, 1.0, 1.0, 1.0, 1.0, 1.0)
"""The cut-off of each step in units of the last one: the round fit's radius may be 0.6 mm off."""
_HALF_FACE = 0.577
"""Half the length of a hexagon's face in units of its inner radius."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HexagonFit:
    """A hexagon seen along its axis."""

    centre_mm: FloatArray
    """Shape (2,)."""
    radius_mm: float
    """Half the spanner size."""
    support: float
    """Smallest eigenvalue of the centre's information, radius and turn being unknown."""
    sigma_mm: float
    """1 sigma of the centre in its worse direction, from leaving out a face at a time."""
    explained: float
    """Share of the flank's weight that lies on the faces, 0 to 1."""


def fit_hexagon(
    points: FloatArray,
    directions: FloatArray,
    weights: FloatArray,
    centre_mm: FloatArray,
    radius_mm: float,
    cutoff_mm: float,
) -> HexagonFit | None:
    """Fit six faces at one distance from a centre, 60 degrees apart.

    A point belongs to the face its normal is nearest to; the face's direction, not the point's
    own normal, enters the equation: near corners estimated normals turn round, which a fit of a
    cylinder reads as a shifted centre.

    Args:
        points: Shape (N, 2), mm, across the axis.
        directions: Shape (N, 2), unit, horizontal parts of the outward normals.
        weights: Shape (N,), how much each point counts as flank.
        centre_mm: Shape (2,), within about 1 mm.
        radius_mm: Within about 0.5 mm.
        cutoff_mm: Of Tukey's weights.

    Returns:
        The fit, or None if fewer than three faces carry it.
    """
    on_flank = weights > 0
    xy, direction, weights = points[on_flank], directions[on_flank], weights[on_flank]
    if len(xy) < 12:
        return None
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    phase = float(np.angle(np.sum(weights * np.exp(1j * _FACES * angle))) / _FACES)
    centre, radius = np.array(centre_mm), radius_mm
    rows = np.zeros((len(xy), 4))
    residual = on_face = face_weight = np.zeros(len(xy))
    face = np.zeros(len(xy), dtype=np.int64)
    for widening in _WIDENING:
        cutoff = widening * cutoff_mm
        face = np.round((angle - phase) / _FACE_RAD).astype(np.int64) % _FACES
        normal_angle = phase + face * _FACE_RAD
        normal = np.column_stack([np.cos(normal_angle), np.sin(normal_angle)])
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        arm = xy - centre
        beside = np.einsum("ni,ni->n", arm, tangent)
        residual = np.einsum("ni,ni->n", arm, normal) - radius
        on_face = weights * tukey_weights(residual, cutoff)
        on_face = on_face * (np.abs(beside) < _HALF_FACE * radius + cutoff)
        total = np.bincount(face, on_face, _FACES)
        if (total > 1.0).sum() < 3:
            return None
        typical = float(np.median(total[total > 1.0]))
        face_weight = on_face * np.minimum(typical / np.maximum(total, 1.0), 1.5)[face]
        # residual falls with centre and radius, and changes by `beside` per rad of phase
        rows = np.column_stack([normal, np.ones(len(xy)), -beside])
        matrix, step = _solve(rows, residual, face_weight)
        centre = centre + step[:2]
        radius = float(radius + step[2])
        phase = float(phase + step[3])
    matrix, _ = _solve(rows, residual, face_weight)
    coupling = matrix[:2, 2:]
    information = matrix[:2, :2] - coupling @ np.linalg.solve(matrix[2:, 2:], coupling.T)
    steps = np.stack(
        [_solve(rows, residual, face_weight * (face != k))[1][:2] for k in range(_FACES)]
    )
    spread = steps - steps.mean(axis=0)
    covariance = (_FACES - 1) / _FACES * spread.T @ spread
    return HexagonFit(
        centre_mm=centre,
        radius_mm=radius,
        support=max(float(np.linalg.eigvalsh(information)[0]), 0.0),
        sigma_mm=float(np.sqrt(np.linalg.eigvalsh(covariance)[-1])),
        explained=float(on_face.sum() / weights.sum()),
    )


def _solve(
    rows: FloatArray, residual: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    matrix = np.einsum("ni,n,nj->ij", rows, weight, rows) + 1e-3 * np.eye(4)
    return matrix, np.linalg.solve(matrix, np.einsum("ni,n,n->i", rows, weight, residual))
