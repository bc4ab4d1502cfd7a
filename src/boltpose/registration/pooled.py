"""Numbers of several views of one motor, told as if one camera had seen it all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from boltpose.arrays import FloatArray
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.registration.evidence import EVIDENCE_NAMES, Evidence
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.scene import Scene, Standing, judge_surface

BY_POINTS = ("explained", "tight", "weakest_tight", "sunk")
"""Shares of points: averaged by how many motor points a view has."""
BY_SURFACE = ("free_space_violation", "coverage", "measured")
"""Shares of the surface: averaged by how much of it a view can judge."""
OF_ALL = ("motor_points", "judged_points", "margin", "bolt_sigma_mm", "converged")
"""Not to be had from the numbers of the views."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SeenPose:
    """A pose in one view, with what the view says of it."""

    camera_from_prior: Transform
    motor_points: FloatArray
    """Shape (N, 3), mm, frame `camera`: what was taken for the motor."""
    scene: Scene
    evidence: Evidence


def pool_evidence(
    views: Sequence[SeenPose],
    prepared: PreparedPrior,
    *,
    margin: float,
    bolt_sigma_mm: float,
    free_space_mm: float,
) -> Evidence:
    """Put the numbers of all views together.

    Surface that two views see counts once, or else a corner seen four times would pass for a
    motor.

    Args:
        views: At least one.
        prepared: The prior.
        margin: Score of the joint pose over all views, ahead of the best clearly different one.
        bolt_sigma_mm: Largest 1 sigma of a bolt's position in the joint pose.
        free_space_mm: As in `EvidenceConfig`.

    Returns:
        The evidence of all views together.
    """
    points = np.concatenate(
        [view.camera_from_prior.inverse().apply(view.motor_points) for view in views]
    )
    judged = np.zeros(len(prepared.coarse_points), dtype=np.bool_)
    for view in views:
        standing = judge_surface(
            view.scene, view.camera_from_prior, prepared, tolerance_mm=free_space_mm
        )
        judged |= (standing == Standing.CONFIRMED) | (standing == Standing.VIOLATING)
    values: dict[str, Any] = {
        "motor_points": len(voxel_downsample(points, 2.0)) if len(points) else 0,
        "judged_points": int(judged.sum()),
        "margin": margin,
        "bolt_sigma_mm": bolt_sigma_mm,
        "converged": all(view.evidence.converged for view in views),
    }
    for name in EVIDENCE_NAMES:
        found = np.array([float(getattr(view.evidence, name)) for view in views])
        if name in BY_POINTS:
            values[name] = _mean(found, [view.evidence.motor_points for view in views])
        elif name in BY_SURFACE:
            values[name] = _mean(found, [view.evidence.judged_points for view in views])
    return Evidence(**values)


def _mean(values: FloatArray, counts: Sequence[int]) -> float:
    weights = np.asarray(counts, dtype=np.float64)
    if not weights.any():
        weights = np.ones(len(counts))
    return float(values @ weights / weights.sum())
