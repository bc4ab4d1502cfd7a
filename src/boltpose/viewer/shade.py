"""Light and shade for points: the browser draws them flat, so the light is in their colours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.geometry.normals import estimate_normals, orient_towards
from boltpose.geometry.sampling import voxel_downsample

_ENOUGH = 60_000
"""Normals are fitted at about so many points; the others take that of the nearest of them."""


def light(normals: FloatArray, up: FloatArray, towards_viewer: FloatArray) -> FloatArray:
    """Brightness of a matt surface under a lamp beside the first viewer and a bright sky.

    Args:
        normals: Shape (N, 3), unit, out of the surface.
        up: Shape (3,), unit: where the sky is.
        towards_viewer: Shape (3,), unit.

    Returns:
        Shape (N,), 0.3 to 1.15.
    """
    lamp = towards_viewer + 0.6 * up + 0.5 * np.cross(up, towards_viewer)
    lamp /= np.linalg.norm(lamp)
    direct = np.clip(normals @ lamp, 0.0, None)
    sky = 0.5 + 0.5 * (normals @ up)
    return 0.30 + 0.62 * direct + 0.23 * sky


def lit_colors(tints: FloatArray, brightness: FloatArray) -> UInt8Array:
    """Colours to send: `tints`, shape (N, 3), 0 to 1, under a brightness, shape (N,)."""
    return np.clip(255.0 * tints * brightness[:, None] + 0.5, 0, 255).astype(np.uint8)


class ScanNormals:
    """Normals of a scan, fitted on a thinned copy: a million of them in a second."""

    def __init__(self, points: FloatArray, viewpoint: FloatArray, spacing_mm: float) -> None:
        """Fit them.

        Args:
            points: Shape (N, 3), mm.
            viewpoint: Shape (3,): the camera, which saw every point from in front.
            spacing_mm: A voxel that leaves some ten thousand points.
        """
        some = points[:: max(1, len(points) // (5 * _ENOUGH))]
        thin = voxel_downsample(some, spacing_mm)
        thin = thin[:: max(1, len(thin) // _ENOUGH)]
        if len(thin) < 3:
            self._tree, self._normals = None, np.zeros((0, 3))
            return
        normals = estimate_normals(thin, 9)
        self._normals = orient_towards(thin, normals, viewpoint)
        self._tree = KDTree(thin)

    def at(self, points: FloatArray) -> FloatArray:
        """Normals at points, shape (N, 3); unit, towards the viewpoint."""
        if self._tree is None:
            return np.tile([0.0, 0.0, 1.0], (len(points), 1))
        # an approximate neighbour is as good for a colour, and twice as fast
        _, nearest = self._tree.query(points, eps=0.5, workers=1)
        return self._normals[nearest]
