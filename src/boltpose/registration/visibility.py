"""How much of each bolt's head the camera measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import FloatArray, as_points
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import VisibilityConfig
from boltpose.registration.prepare import PreparedPrior
from boltpose.schema import Part, PriorBolt, Visibility

_REACH_DIAMETERS = 0.85
"""Labelled points this many head diameters around the axis are the head: a flange reaches 0.68
of the spanner size, and bolts stand farther apart."""
_DEPTH_SLACK_MM = 1.0
"""The same along the axis, beyond the head's height."""
_SPACINGS = 1.2
"""On a covered surface no point is farther than this many spacings from a scan point."""
_LARGEST_REACH_MM = 2.0
"""A scan coarser than this says nothing about a bolt head of 4 mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoltSight:
    """What was seen of one bolt."""

    bolt_id: str
    visible_fraction: float
    """Share of the head's surface, as the prior has it, with a scan point near; 0 to 1."""
    scan_points: int
    """Scan points on the head."""
    visibility: Visibility


def see_bolts(
    prepared: PreparedPrior,
    camera_from_prior: Transform,
    scan_points: npt.ArrayLike,
    config: VisibilityConfig | None = None,
) -> tuple[BoltSight, ...]:
    """Measure how much of every bolt's head the scan holds.

    Args:
        prepared: The prior.
        camera_from_prior: Its verified pose.
        scan_points: Shape (N, 3), mm, frame `camera`: the whole scan in full resolution.
        config: Settings.

    Returns:
        One record per bolt, in the prior's order.

    Raises:
        ShapeError: `scan_points` is not (N, 3) and finite.
    """
    config = config or VisibilityConfig()
    points = as_points(scan_points, "scan_points", at_least=0)
    squared = np.einsum("ni,ni->n", points, points)
    sights: list[BoltSight] = []
    for bolt in prepared.prior.bolts:
        head = camera_from_prior.apply(head_surface(prepared, bolt))
        near = points
        if len(head):
            centre = head.mean(axis=0)
            reach = np.linalg.norm(head - centre, axis=1).max() + _LARGEST_REACH_MM
            # |p - c|^2 < r^2, with one pass over millions of points instead of six
            near = points[squared - 2.0 * (points @ centre) < reach**2 - centre @ centre]
        sights.append(_see_bolt(bolt, head, near, config))
    return tuple(sights)


def classify_visibility(fraction: float, scan_points: int, config: VisibilityConfig) -> Visibility:
    """Name what a fraction and a number of scan points on the head amount to."""
    if fraction < config.partial_share or scan_points < config.min_points:
        return Visibility.HIDDEN
    return Visibility.VISIBLE if fraction >= config.visible_share else Visibility.PARTIAL


def head_surface(prepared: PreparedPrior, bolt: PriorBolt) -> FloatArray:
    """Return the prior's points on a bolt's head, shape (H, 3), mm, frame `prior`.

    Where the labels leave fewer than ten, as for a bolt placed by hand, all points within the
    head's cylinder are taken.
    """
    reach = _REACH_DIAMETERS * bolt.head_diameter_mm
    depth = bolt.head_height_mm + _DEPTH_SLACK_MM
    rows = np.array(
        prepared.tree.query_ball_point(
            bolt.prior_from_bolt.translation_mm, float(np.hypot(reach, depth))
        ),
        dtype=np.int64,
    )
    rows.sort()
    local = bolt.prior_from_bolt.inverse().apply(prepared.points[rows])
    from_axis = np.hypot(local[:, 0], local[:, 1])
    inside = (local[:, 2] > -depth) & (local[:, 2] < 1.5)
    labelled = inside & (from_axis < reach) & (prepared.prior.labels[rows] == Part.BOLT)
    if labelled.sum() < 10:
        labelled = inside & (from_axis < 0.5 * bolt.head_diameter_mm + 0.5)
    return prepared.points[rows[labelled]]


def _see_bolt(
    bolt: PriorBolt, head: FloatArray, near: FloatArray, config: VisibilityConfig
) -> BoltSight:
    fraction, count = 0.0, 0
    if len(head) and len(near) > 1:
        tree = KDTree(near)
        spacing, _ = tree.query(near[:: max(1, len(near) // 200)], k=2)
        reach = max(config.tolerance_mm, _SPACINGS * float(np.median(spacing[:, 1])))
        reach = min(reach, _LARGEST_REACH_MM)
        distance, _ = tree.query(head, distance_upper_bound=reach)
        fraction = float(np.isfinite(distance).mean())
        back, _ = KDTree(head).query(near, distance_upper_bound=reach)
        count = int(np.isfinite(back).sum())
    return BoltSight(
        bolt_id=bolt.id,
        visible_fraction=fraction,
        scan_points=count,
        visibility=classify_visibility(fraction, count, config),
    )
