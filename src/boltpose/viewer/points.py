"""A layer of points that is sent whole: a prior, or anything else of some hundred thousand."""

from __future__ import annotations

import numpy as np

from boltpose.arrays import FloatArray, UInt8Array
from boltpose.viewer.page import Page
from boltpose.viewer.pick import PickLayer
from boltpose.viewer.web import viser

POINT_WIDTH = 1.35
"""Points are drawn this much wider than they lie apart, so that a surface has no holes."""


class PointLayer:
    """Coloured points under a name; clicks find them."""

    def __init__(self, page: Page, name: str) -> None:
        """An empty layer.

        Args:
            page: Where it is shown.
            name: One layer of a name per page; `SurfaceClick.layer` tells it.
        """
        self._page = page
        self._name = name
        self._handle: viser.PointCloudHandle | None = None
        self._is_visible = True
        self._pick: PickLayer | None = None

    def show(self, points: FloatArray, colors: UInt8Array, spacing_mm: float) -> None:
        """Show these points instead of those before.

        Args:
            points: Shape (N, 3), mm, frame of the page.
            colors: Shape (N, 3), RGB.
            spacing_mm: Distance of neighbours.
        """
        self.clear()
        if len(points) == 0:
            return
        # half floats about the middle: 0.03 mm within 100 mm, and half the bytes
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        self._handle = self._page.server.scene.add_point_cloud(
            f"/{self._name}",
            points=points - middle,
            colors=colors,
            point_size=POINT_WIDTH * spacing_mm,
            point_shape="circle",
            point_shading="flat",
            position=middle,
            visible=self._is_visible,
        )
        self._pick = PickLayer(
            name=self._name, points=points, spacing_mm=spacing_mm, is_shown=self._is_visible
        )
        self._page.make_pickable(self._pick)

    def recolor(self, colors: UInt8Array) -> None:
        """Give the points shown other colours; shape (N, 3), RGB."""
        if self._handle is not None:
            self._handle.colors = colors

    def clear(self) -> None:
        """Show nothing."""
        if self._handle is not None:
            self._handle.remove()
            self._handle = None
        self._page.forget_pickable(self._name)
        self._pick = None

    def set_visible(self, is_visible: bool) -> None:
        """Show or hide the layer; a hidden one cannot be clicked on."""
        self._is_visible = is_visible
        if self._handle is not None:
            self._handle.visible = is_visible
        if self._pick is not None:
            self._pick.is_shown = is_visible


def spacing_of(points: FloatArray) -> float:
    """Typical distance of neighbours, mm, shape (N, 3); 1 where there are too few to tell."""
    if len(points) < 5:
        return 1.0
    from scipy.spatial import KDTree

    sample = points[:: max(1, len(points) // 2000)]
    distance, _ = KDTree(points).query(sample, k=5)
    return float(max(np.median(distance[:, -1]), 1e-3))
