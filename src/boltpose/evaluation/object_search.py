"""Find any object in clutter with the registration and the verdict of `locate`.

The networks know motors only. For other objects a ball about each place of the scene is offered
as mask; what registers is relabelled, registered again and judged, as `locate` does it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from boltpose.arrays import as_points
from boltpose.errors import ConfigError
from boltpose.geometry.normals import estimate_normals, orient_outward
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform, rotation_angle_rad
from boltpose.registration.prepare import PreparedPrior
from boltpose.registration.register import register
from boltpose.registration.relabel import relabel
from boltpose.registration.scene import Scene, build_scene
from boltpose.registration.verify import verify
from boltpose.schema import Alignment, Part, Prior, Registration, Scan, Status, Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchConfig:
    """Where to look, and what is one pose."""

    spacing_mm: float = 110.0
    """Places to look at are this far apart."""
    ball_share: float = 0.5
    """Radius of the ball as a share of the object's: half of it shows enough to register."""
    min_points: int = 2000
    """Balls with fewer scan points are skipped."""
    relabel_mm: float = 3.0
    """After the first pose the object is what lies this near to it."""
    same_angle_rad: float = 0.087
    """Poses closer than this (5 degrees) and `same_shift_mm` are one."""
    same_shift_mm: float = 5.0

    def __post_init__(self) -> None:
        for name in ("spacing_mm", "ball_share", "relabel_mm", "same_angle_rad", "same_shift_mm"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")
        if not self.min_points >= 3:
            raise ConfigError(f"min_points must be >= 3, got {self.min_points}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Finding:
    """What came of one place."""

    verdict: Verdict
    registration: Registration | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchResult:
    """What came of all places."""

    findings: tuple[Finding, ...]
    """In the order of the places."""
    poses: tuple[Transform, ...]
    """Distinct accepted poses `camera_from_prior`, the one accepted most often first."""
    votes: tuple[int, ...]
    """How many places led to each."""


def prior_of_object(points: npt.ArrayLike, name: str) -> Prior:
    """Make a prior without bolts, axes or parts of a complete scan of any object.

    Args:
        points: Shape (N, 3), mm, about 1 mm apart; its frame becomes frame `prior`.
        name: What the object is called.

    Returns:
        The prior; all of it is labelled as housing, which registration takes for rigid.

    Raises:
        ShapeError: `points` is not (N >= 3, 3) and finite.
    """
    cloud = as_points(points, "points", at_least=3)
    normals = orient_outward(cloud, estimate_normals(cloud))
    return Prior(
        name=name,
        points=cloud,
        normals=normals,
        labels=np.full(len(cloud), Part.MAIN_HOUSING, dtype=np.uint8),
        bolts=(),
        alignment=Alignment(
            prior_from_motor=Transform.identity("prior", "motor"),
            axis_spread_rad=float(np.pi),
            axis_sigma_rad=float(np.pi),
            normal_count=0,
            inlier_ratio=0.0,
            has_solenoid=False,
        ),
        provenance={"kind": "object without bolts"},
    )


def search_object(
    prepared: PreparedPrior, scan: Scan, config: SearchConfig | None = None
) -> SearchResult:
    """Look for an object everywhere in a scan.

    Args:
        prepared: The object.
        scan: One view, mm, frame `camera`.
        config: Settings.

    Returns:
        Every place's verdict and the distinct accepted poses.
    """
    settings = config or SearchConfig()
    scene = build_scene(scan.points)
    tree = KDTree(scan.points)
    findings: list[Finding] = []
    for place in voxel_downsample(scan.points, settings.spacing_mm):
        ball = tree.query_ball_point(place, settings.ball_share * prepared.radius_mm)
        if len(ball) >= settings.min_points:
            findings.append(_try_ball(prepared, scan, scene, np.sort(ball), settings))
    poses, votes = _distinct(findings, prepared, settings)
    return SearchResult(findings=tuple(findings), poses=poses, votes=votes)


def _try_ball(
    prepared: PreparedPrior,
    scan: Scan,
    scene: Scene,
    ball: npt.NDArray[np.int64],
    config: SearchConfig,
) -> Finding:
    best = register(prepared, scan.points[ball], scene=scene).best
    points = scan.points[ball]
    if best is not None:
        is_object = relabel(
            prepared, best.camera_from_prior, scan.points, threshold_mm=config.relabel_mm
        )
        points = scan.points[is_object]
        best = register(prepared, points, scene=scene).best
    verdict = verify(best, prepared, scene, points)
    return Finding(verdict=verdict, registration=best)


def _distinct(
    findings: list[Finding], prepared: PreparedPrior, config: SearchConfig
) -> tuple[tuple[Transform, ...], tuple[int, ...]]:
    groups: list[list[Transform]] = []
    for finding in findings:
        if finding.verdict.status is not Status.OK or finding.registration is None:
            continue
        pose = finding.registration.camera_from_prior
        for group in groups:
            turn = rotation_angle_rad(group[0].rotation.T @ pose.rotation)
            shift = pose.apply(prepared.centre_mm) - group[0].apply(prepared.centre_mm)
            if turn < config.same_angle_rad and np.linalg.norm(shift) < config.same_shift_mm:
                group.append(pose)
                break
        else:
            groups.append([pose])
    groups.sort(key=lambda group: -len(group))
    return tuple(group[0] for group in groups), tuple(len(group) for group in groups)
