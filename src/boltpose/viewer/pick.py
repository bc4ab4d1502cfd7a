"""Which point of a cloud is under the mouse; the browser knows rays, not points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boltpose.arrays import FloatArray

_REACH = 0.006
"""A point this far beside the ray, as a share of its distance, is under the mouse: 6 pixels of a
picture that is 1000 pixels high."""


@dataclass(slots=True, eq=False, kw_only=True)
class PickLayer:
    """A cloud that can be clicked on."""

    name: str
    points: FloatArray
    """Shape (N, 3), mm, frame of the page."""
    spacing_mm: float
    """Distance of neighbours: a ray passes between two points of the surface it hits."""
    is_shown: bool = True


def pick_point(
    layers: Sequence[PickLayer], origin_mm: FloatArray, direction: FloatArray
) -> tuple[PickLayer, int] | None:
    """Find the surface a ray meets first, and on it the point nearest to the ray.

    Args:
        layers: Those not shown are passed through.
        origin_mm: Shape (3,): where the viewer stands.
        direction: Shape (3,), any length but 0.

    Returns:
        The layer and the row of its point; None where the ray meets nothing.
    """
    towards = direction / np.linalg.norm(direction)
    best: tuple[float, PickLayer, int] | None = None
    for layer in layers:
        if not layer.is_shown or len(layer.points) == 0:
            continue
        offset = layer.points - origin_mm
        depth = offset @ towards
        beside2 = np.einsum("ni,ni->n", offset, offset) - depth**2
        reach = np.maximum(layer.spacing_mm, _REACH * depth)
        hit = np.flatnonzero((depth > 0) & (beside2 < reach**2))
        if len(hit) == 0:
            continue
        # within the front surface the nearest to the ray, not the one nearest to the viewer
        first = float(depth[hit].min())
        front = hit[depth[hit] < first + 3 * layer.spacing_mm]
        row = int(front[np.argmin(beside2[front])])
        if best is None or depth[row] < best[0]:
            best = (float(depth[row]), layer, row)
    return None if best is None else best[1:]
