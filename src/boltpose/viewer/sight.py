"""What the camera saw of a registered motor, and what stood before it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from scipy.spatial import KDTree

from boltpose.arrays import BoolArray, FloatArray, IntArray
from boltpose.geometry.transforms import Transform
from boltpose.registration.config import EvidenceConfig
from boltpose.registration.prepare import prepare_prior
from boltpose.registration.scene import Standing, build_scene, judge_surface
from boltpose.schema import Prior, Scan

_NORMAL_MM = 3.0
"""A normal counts as so many mm: the two sides of a sheet stay apart."""


class Seen(IntEnum):
    """What became of a point of the registered prior; the words are those of the page."""

    SEEN = 0
    HIDDEN = 1
    UNMEASURED = 2
    TURNED_AWAY = 3
    SEEN_THROUGH = 4


WORDS = {
    Seen.SEEN: "seen",
    Seen.HIDDEN: "hidden: something stands before it",
    Seen.UNMEASURED: "in view, but not measured",
    Seen.TURNED_AWAY: "on the far side, or behind the motor itself",
    Seen.SEEN_THROUGH: "seen through: not where the prior says",
}
_SEEN_OF = {
    Standing.CONFIRMED: Seen.SEEN,
    Standing.OCCLUDED: Seen.HIDDEN,
    Standing.UNMEASURED: Seen.UNMEASURED,
    Standing.NOT_FACING: Seen.TURNED_AWAY,
    Standing.VIOLATING: Seen.SEEN_THROUGH,
}


class MotorSight:
    """How a registered prior and a scan stand against each other, seen from the camera.

    The judgement is the verdict's own (`registration.scene.judge_surface`), for every point.
    """

    def __init__(self, scan: Scan, prior: Prior, camera_from_prior: Transform) -> None:
        """Judge.

        Args:
            scan: Frame `camera`.
            prior: Of the motor, with points.
            camera_from_prior: Its accepted pose.
        """
        self._tolerance_mm = EvidenceConfig().free_space_mm
        prepared = prepare_prior(prior)
        standing = judge_surface(
            build_scene(scan.points),
            camera_from_prior,
            prepared,
            tolerance_mm=self._tolerance_mm,
        )
        seen = np.zeros(len(Standing), dtype=np.int64)
        for was, found in _SEEN_OF.items():
            seen[was] = found
        # judged was the thinned surface; a point takes the word of its neighbour on its own side
        thin = np.hstack([prepared.coarse_points, _NORMAL_MM * prepared.coarse_normals])
        full = np.hstack([prepared.points, _NORMAL_MM * prepared.normals])
        _, nearest = KDTree(thin).query(full, workers=-1)
        self.of_prior: IntArray = seen[standing[nearest]]
        """Shape (N,), `Seen` numbers of the prior's points."""
        self._motor = build_scene(camera_from_prior.apply(prepared.coarse_points))

    def is_before(self, points_camera: FloatArray) -> BoolArray:
        """Tell which scan points, (K, 3), mm, stand clearly before the motor and hide some of it.

        The motor's own points do not: call it for those that are not on its surface.
        """
        row, column, inside = self._motor.cells(points_camera)
        nearest = self._motor.nearest_mm[row, column]
        return (
            inside
            & self._motor.is_measured[row, column]
            & (points_camera[:, 2] < nearest - self._tolerance_mm)
        )
