"""The region of interest that many robot cells cut their scans to before anyone else sees them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.factory.model import SceneModel, bounds_mm
from boltpose.geometry.transforms import Transform
from boltpose.schema import Part
from boltpose.sensor.structured_light import CapturedView

_FILTERED = 0.5
"""Share of the views that are cut. Ours: cells do both."""
_MARGIN_MM = (-30.0, 120.0)
"""How far the region reaches beyond motor and fixture, each side by itself: some boxes are set
tightly and cut the plate, some widely."""
_BARE = 0.15
"""Share of the regions that end above the base plate."""
_ABOVE_PLATE_MM = (2.0, 12.0)
_BELOW_PLATE_MM = (3.0, 40.0)
"""Where the region ends below: just under the plate's top, or under the plate and in the table."""
_CENTRAL_MM = 40.0
"""What lies within this of the motor's outline belongs to the fixture, not to the clutter."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Region:
    """A box in frame `table`; what lies outside was cut away."""

    low: FloatArray
    """Shape (3,), mm."""
    high: FloatArray
    """Shape (3,), mm."""

    def cut(self, captured: CapturedView, table_from_camera: Transform) -> CapturedView:
        """Forget the pixels whose points lie outside."""
        points = table_from_camera.apply(captured.points())
        outside = ((points < self.low) | (points > self.high)).any(axis=1)
        gone = captured.pixels[outside]
        depth, labels, index = (
            array.copy() for array in (captured.depth_mm, captured.labels, captured.solid_index)
        )
        depth.reshape(-1)[gone] = 0
        labels.reshape(-1)[gone] = Part.BACKGROUND
        index.reshape(-1)[gone] = -1
        return replace(captured, depth_mm=depth, labels=labels, solid_index=index)


def draw_region(scene: SceneModel, rng: np.random.Generator) -> Region | None:
    """Draw the region that a cell engineer has set around the clamp; None for no region.

    The motor is always inside: a region that cuts it is an error of set-up, not a scan.
    """
    chance, bare, floor, *margins = rng.random(7)
    if chance >= _FILTERED:
        return None
    motor = bounds_mm([solid for solid in scene.solids if solid.part != Part.BACKGROUND])
    low, high = motor[0] - _CENTRAL_MM, motor[1] + _CENTRAL_MM
    spread = _MARGIN_MM[0] + (_MARGIN_MM[1] - _MARGIN_MM[0]) * np.array(margins)
    low[:2] -= spread[:2]
    high[:2] += spread[2:]
    if bare < _BARE:
        low[2] = _ABOVE_PLATE_MM[0] + floor * (_ABOVE_PLATE_MM[1] - _ABOVE_PLATE_MM[0])
        low[2] = min(low[2], float(motor[0, 2]) - 1)
    else:
        low[2] = -_BELOW_PLATE_MM[0] - floor * (_BELOW_PLATE_MM[1] - _BELOW_PLATE_MM[0])
    high[2] = np.inf
    return Region(low=low, high=high)
