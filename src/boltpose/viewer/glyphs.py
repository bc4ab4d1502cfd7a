"""The shape of a bolt's mark in 3D: shape and colour both say what the camera saw of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from boltpose.arrays import FloatArray, IntArray
from boltpose.picture.bolt_marks import Ink

ARROW_MM = 32.0
_SHAFT_MM, _TIP_RADIUS_MM, _TIP_MM = 1.3, 3.4, 9.0
_DASHES = 4
_SIDES = 24


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shape:
    """A mesh."""

    vertices: FloatArray
    """Shape (N, 3), mm."""
    faces: IntArray
    """Shape (M, 3)."""


def bolt_shape(ink: Ink, head_diameter_mm: float, head_height_mm: float) -> Shape:
    """Make the mark of a bolt, frame `bolt`: its origin on the top face of the head.

    A bolt that was seen has a full head and a full arrow, one partly seen a ring and a full arrow,
    a hidden one a ring and a dashed arrow. One that the camera contradicts is crossed out and has
    no arrow: there is nothing to follow.

    Args:
        ink: How it is drawn.
        head_diameter_mm: Of the head.
        head_height_mm: Of the head.
    """
    radius = head_diameter_mm / 2 + 0.3  # a little larger than the measured head, or it flickers
    if ink is Ink.FORBIDDEN:
        return _join(_cross(1.35 * max(radius, 5.0)))
    height = max(head_height_mm, 1.0)
    if ink is Ink.SEEN:
        head = trimesh.creation.cylinder(radius, height=height, sections=_SIDES)
    else:
        head = trimesh.creation.annulus(radius - 0.2, radius + 1.2, height, sections=_SIDES)
    head.apply_translation((0, 0, 0.3 - height / 2))
    return _join([head, *_arrow(ink is Ink.HIDDEN)])


def ellipsoid_axes(covariance_mm2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Half axes of the 1 sigma ellipsoid of a point.

    Args:
        covariance_mm2: Shape (3, 3).

    Returns:
        Shape (3,), mm, and a proper rotation, shape (3, 3), whose columns are their directions.
    """
    values, vectors = np.linalg.eigh(covariance_mm2)
    if np.linalg.det(vectors) < 0:
        vectors[:, 0] *= -1
    return np.sqrt(np.maximum(values, 0.0)), vectors


def _arrow(is_dashed: bool) -> list[trimesh.Trimesh]:
    end = ARROW_MM - _TIP_MM
    bounds = [(0.0, end)]
    if is_dashed:
        ticks = np.linspace(0.0, end, 2 * _DASHES)
        bounds = [(float(a), float(b)) for a, b in zip(ticks[::2], ticks[1::2], strict=True)]
    parts = [
        trimesh.creation.cylinder(_SHAFT_MM, segment=((0, 0, low), (0, 0, high)), sections=12)
        for low, high in bounds
    ]
    tip = trimesh.creation.cone(_TIP_RADIUS_MM, _TIP_MM, sections=_SIDES)
    tip.apply_translation((0, 0, end))
    return [*parts, tip]


def _cross(reach_mm: float) -> list[trimesh.Trimesh]:
    bars = []
    for angle in (np.pi / 4, -np.pi / 4):
        bar = trimesh.creation.box((2 * reach_mm, 3.0, 3.0))
        bar.apply_transform(trimesh.transformations.rotation_matrix(angle, (0, 0, 1)))
        bar.apply_translation((0, 0, 2.0))
        bars.append(bar)
    return bars


def _join(parts: list[trimesh.Trimesh]) -> Shape:
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Shape(
        vertices=np.vstack([part.vertices for part in parts]),
        faces=np.vstack([part.faces + start for part, start in zip(parts, starts, strict=False)]),
    )
