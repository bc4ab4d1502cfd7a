"""Settings of registration, verification and visibility."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

from boltpose.errors import ConfigError
from boltpose.registration.probability_config import ProbabilityConfig

Method = Literal["multi_start", "paper", "paper_point_to_point"]


def _require_positive(config: object, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(config, name)
        if not value > 0:  # written so that NaN fails too
            raise ConfigError(f"{name} must be > 0, got {value}")


def _require_shares(config: object, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(config, name)
        if not 0 <= value <= 1:
            raise ConfigError(f"{name} must lie between 0 and 1, got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class PrepareConfig:
    """What is computed once per prior."""

    grid_cell_mm: float = 2.5
    """Cell of the nearest-point grid of the coarse stage (FINDINGS section 1)."""
    grid_margin_mm: float = 30.0
    """How far the grid reaches beyond the motor; the coarse stage pairs up to this distance."""
    coarse_voxel_mm: float = 1.5
    """Spacing of the surface behind the grid."""
    view_directions: int = 64
    """Directions, evenly spread, from which the motor may be seen."""
    view_cell_mm: float = 4.0
    """Cell of the depth buffer that tells what a direction sees."""

    def __post_init__(self) -> None:
        _require_positive(self, tuple(f.name for f in fields(self)))


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseConfig:
    """Multi-start ICP: many start poses at once, the best ones go on."""

    rolls: int = 15
    """Turns about each viewing direction, evenly spread."""
    scout_points: int = 50
    scout_steps: int = 2
    """So many of the first steps are taken on a few points only ..."""
    scout_share: float = 0.4
    """... and this share of the start poses, the best by then, goes on."""
    first_points: int = 100
    first_steps: int = 6
    first_distance_mm: tuple[float, float] = (30.0, 12.0)
    """Largest pair distance in the first and the last step."""
    kept: int = 60
    """Start poses that go on to the second round."""
    second_points: int = 500
    second_steps: int = 10
    second_distance_mm: tuple[float, float] = (12.0, 3.0)
    cluster_angle_rad: float = 0.0873
    """Poses closer than this (5 degrees) and `cluster_shift_mm` are one candidate."""
    cluster_shift_mm: float = 5.0
    candidates: int = 6
    """Distinct poses handed on."""
    convincing_score: float = 0.75
    """Below this the offsets are tried as well."""
    offset_mm: float = 40.0
    """Shift of the centroids along the six directions of the fallback: clamp points in the mask
    pull the centroid away (31 mm in the worst case measured, FINDINGS section 1)."""
    threads: int = 2
    """Start poses are worked on in this many chunks at once; the result does not depend on it."""
    seed: int = 0
    """Of the choice of target points."""

    def __post_init__(self) -> None:
        _require_positive(
            self,
            (
                "rolls",
                "scout_points",
                "scout_steps",
                "scout_share",
                "first_points",
                "first_steps",
                "kept",
                "second_points",
                "second_steps",
                "cluster_angle_rad",
                "cluster_shift_mm",
                "candidates",
                "offset_mm",
                "threads",
            ),
        )
        _require_shares(self, ("scout_share", "convincing_score"))
        if self.scout_steps > self.first_steps:
            raise ConfigError(
                f"scout_steps must not exceed first_steps, "
                f"got {self.scout_steps} > {self.first_steps}"
            )
        for name in ("first_distance_mm", "second_distance_mm"):
            start, end = getattr(self, name)
            if not 0 < end <= start:
                raise ConfigError(f"{name} must fall from a positive start, got {start} to {end}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FineStep:
    """One resolution of the fine stage."""

    voxel_mm: float
    """Scan points are thinned to this spacing."""
    max_distance_mm: float
    """Pairs farther apart than this are ignored."""
    kernel_mm: float
    """Scale of the Tukey kernel: residuals beyond 4.685 times it count nothing."""
    iterations: int = 15
    """Reaching it in the last resolution is reported as `converged=False`."""

    def __post_init__(self) -> None:
        _require_positive(self, tuple(f.name for f in fields(self)))


@dataclass(frozen=True, slots=True, kw_only=True)
class FineConfig:
    """Point-to-plane refinement, scan to prior."""

    steps: tuple[FineStep, ...] = (
        FineStep(voxel_mm=2.0, max_distance_mm=3.0, kernel_mm=0.5),
        FineStep(voxel_mm=1.5, max_distance_mm=1.0, kernel_mm=0.3),
    )
    converged_shift_mm: float = 0.005
    """A step that moves no point of the motor by more than this ends a resolution: a twentieth
    of the 0.1 mm that the camera's own bias leaves."""
    correlation_length_mm: float = 6.0
    """Residuals closer than this are one measurement, not many: ripple, warp and crust are
    correlated over millimetres, so the formal covariance of ICP is far too small."""
    depth_scale_sigma: float = 0.00016
    """1 sigma of the camera's scale error: the motor is this share of its distance nearer or
    farther than measured, all of it, which leaves no residual. With the ripple 0.117 mm at 700 mm;
    0.117 mm measured on the 36 views of the even families of reman18 (simulated), 0.093 on the odd
    ones. The factory's camera has 0.187 mm at 700 mm: a camera has its own number."""
    depth_ripple_mm: float = 0.04
    """1 sigma of what the camera's depth ripple and bias move the motor besides."""
    lateral_sigma_mm: float = 0.02
    """Floor of the translation error across the viewing direction (measured per axis: 0.012 mm on
    reman18, 0.019 in factory scenes)."""
    rotation_sigma_rad: float = 0.0002
    """Floor of the rotation error about each axis, 0.011 degrees (measured: 0.008 on reman18, 0.012
    in factory scenes)."""

    def __post_init__(self) -> None:
        if not self.steps:
            raise ConfigError("steps must name at least one resolution, got none")
        _require_positive(
            self,
            (
                "converged_shift_mm",
                "correlation_length_mm",
                "depth_scale_sigma",
                "depth_ripple_mm",
                "lateral_sigma_mm",
                "rotation_sigma_rad",
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneConfig:
    """The depth buffer of a whole scan."""

    cell_mm: float = 2.8
    """Size of a cell at the scan's median depth: 0.004 rad at 700 mm, as in FINDINGS section 1. It
    must exceed the 1.5 mm between a prior's coarse points, or its back shines through."""
    max_points: int = 300_000
    """Larger scans are thinned by a stride first."""

    def __post_init__(self) -> None:
        _require_positive(self, tuple(f.name for f in fields(self)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperConfig:
    """FPFH + fast global registration + ICP, set up as in FINDINGS ("the peer to beat")."""

    voxel_mm: float = 3.0
    """Both clouds are thinned to this for the features."""
    normal_neighbours: int = 14
    """Neighbours of a scan normal; about the points within 2 voxels."""
    feature_radius_mm: float = 15.0
    """5 voxels, as in the paper's code."""
    match_distance_mm: float = 1.5
    """Half a voxel, as in Open3D's tutorial."""
    icp_voxel_mm: float = 1.0
    icp_distances_mm: tuple[float, ...] = (10.0, 1.0, 0.1)
    """The paper's three steps. At the last about 1 % of the points still find a partner."""
    icp_iterations: int = 30
    """Open3D's default."""
    seed: int = 0

    def __post_init__(self) -> None:
        _require_positive(
            self,
            (
                "voxel_mm",
                "normal_neighbours",
                "feature_radius_mm",
                "match_distance_mm",
                "icp_voxel_mm",
                "icp_iterations",
            ),
        )
        if not self.icp_distances_mm or not all(value > 0 for value in self.icp_distances_mm):
            raise ConfigError(f"icp_distances_mm must all be > 0, got {self.icp_distances_mm}")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationConfig:
    """Everything that turns motor points into candidate poses."""

    method: Method = "multi_start"
    """`multi_start` (default), or the paper's FPFH + FGR + ICP, point-to-plane or -point."""
    min_points: int = 300
    """Fewer motor points (on 2 mm voxels) are not registered at all."""
    max_points: int = 300_000
    """Larger inputs are thinned by a stride first."""
    ranking_points: int = 2000
    """Motor points that rank the coarse candidates."""
    ranking_steps: int = 6
    """Point-to-plane steps on those points before ranking."""
    ranking_tolerance_mm: float = 1.0
    """A point's agreement falls to 0 at this plane residual while candidates are chosen."""
    score_tolerance_mm: float = 0.5
    """The same for the final score: after the fine stage the right pose fits within it, and a
    pose that merely resembles it does not."""
    violation_weight: float = 5.0
    """How much of the score one unit of free-space violation costs. Right poses violate up to
    0.0035, wrong ones from 0.029 (FINDINGS section 1): a wrong pose loses at least 0.15."""
    refined_candidates: int = 3
    """At most so many candidates go through the fine stage."""
    refined_margin: float = 0.15
    """Candidates whose score is this much below the best are not refined."""
    coarse: CoarseConfig = field(default_factory=CoarseConfig)
    fine: FineConfig = field(default_factory=FineConfig)
    paper: PaperConfig = field(default_factory=PaperConfig)

    def __post_init__(self) -> None:
        _require_positive(
            self,
            (
                "min_points",
                "max_points",
                "ranking_points",
                "ranking_steps",
                "ranking_tolerance_mm",
                "score_tolerance_mm",
                "violation_weight",
                "refined_candidates",
                "refined_margin",
            ),
        )
        if self.method not in ("multi_start", "paper", "paper_point_to_point"):
            raise ConfigError(
                f"method must be multi_start, paper or paper_point_to_point, got {self.method!r}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class VisibilityConfig:
    """When a bolt counts as seen."""

    tolerance_mm: float = 0.5
    """A point of the head is seen if the scan has a point this near, or 1.2 times the scan's own
    spacing where that is more. reman18 (simulated) defines 0.7 mm to a pixel *of the bolt*; without
    the labels of the pixels 0.5 mm comes nearest to it: mean error 0.023, 0.7 mm 0.044."""
    min_points: int = 30
    """Scan points on the head below this make no bolt visible, as in reman18."""
    visible_share: float = 0.25
    """From this share on a bolt is `visible`. A head seen from straight above shows about 0.6."""
    partial_share: float = 0.10
    """From this share on a bolt is `partial`, below it `hidden`; reman18 draws the same line."""

    def __post_init__(self) -> None:
        _require_positive(self, ("tolerance_mm", "min_points"))
        _require_shares(self, ("visible_share", "partial_share"))
        if self.partial_share > self.visible_share:
            raise ConfigError(
                f"partial_share must not exceed visible_share, "
                f"got {self.partial_share} > {self.visible_share}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceConfig:
    """How the numbers behind the verdict are measured."""

    free_space_mm: float = 3.0
    """Depth difference beyond which the camera saw through or past a surface (FINDINGS section 1,
    "Verification")."""
    explained_mm: float = 1.5
    """A motor point this near to the posed prior is explained by it."""
    tight_mm: float = 0.35
    """An explained point with a smaller plane residual lies on the surface: about four times the
    0.05-0.12 mm error of a reman18 pixel."""
    coverage_mm: float = 1.5
    """A point of the prior is covered if the scan has one this near, or twice the scan's own
    spacing where that is more."""
    sunk_mm: float = 0.6
    """A scan point deeper inside the posed motor than this cannot have been measured there: five
    times the error of a reman18 pixel, and more than grease or rust can take away."""
    sunk_reach_mm: float = 3.0
    """Scan points farther from the surface are not looked at for that: beyond a thin wall it is
    unclear what is inside."""
    sample_points: int = 10_000
    """Points looked at, by stride: shares are then known to about 0.001."""

    def __post_init__(self) -> None:
        _require_positive(self, tuple(f.name for f in fields(self)))


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyConfig:
    """Thresholds of the verdict.

    What decides is `min_p_correct`, from all numbers together; the others are guards at a distance
    from right poses. Weights and that threshold follow from the even families of reman18 and of
    the factory (simulated), `python -m boltpose.evaluation.hard_fit` prints them; the odd families
    test them on more than 10 000 hard cases (docs/results.md). "Right" and "wrong" below are
    located poses and hard cases of both halves: the guards are no blind test.
    """

    min_motor_points: int = 300
    """On 2 mm voxels, 12 cm2 of surface. Right: at least 2112. Below it nothing is registered."""
    max_free_space_violation: float = 0.012
    """Right: at most 0.0019 on reman18, 0.011 in factory scenes (simulated) with a bolt lost since
    the scan. Mirrored motors: mostly above 0.018, one 0.0006; `p_correct` tells that one. It was
    0.02 until the last of the hard cases, a mirrored motor of the factory, passed at 0.0193."""
    min_explained: float = 0.35
    """Right: at least 0.98 under the true mask, 0.785 with a fifth of clamp points in it, 0.495
    with two motors in view. It guards against masks that are mostly something else; the fit is
    judged by the others."""
    min_tight: float = 0.94
    """Right: at least 0.986 on reman18; 0.93 to 0.98 in factory scenes (simulated) with fresh
    grease, rust and other changes since the scan. Wrong: at most 0.967 (a mirrored scan: most of a
    motor is symmetric) where enough is in view; there `p_correct` sees what this share does not,
    the direction and the place of the misfit."""
    min_coverage: float = 0.55
    """Right: at least 0.869 on reman18, 0.63 in factory scenes (simulated): dropouts at grazing
    incidence and jaws close before the motor cost the rest. No wrong pose fails by it alone."""
    min_judged_points: int = 2000
    """45 cm2 of surface. Right: at least 3939."""
    min_measured: float = 0.5
    """Right: at least 0.868. Lower means that most of the motor in view gave no depth at all: a
    cropped scan, or a motor that is not there."""
    min_margin: float = 0.05
    """Right: at least 0.10 (mostly the bare housing in view, the other pose 7 degrees rolled).
    Poses that a symmetric body cannot tell apart differ by less than 0.03."""
    max_bolt_sigma_mm: float = 0.5
    """Right: at most 0.126, nearly all of it the camera's depth bias. Above it a bolt may stand
    1 mm beside its place without any residual."""
    min_p_correct: float = 0.7
    """Half way, in log odds, between the most likely wrong pose of the even families (0.32, a
    mirrored motor; of poses that the points hold and the single checks pass) and the least likely
    good one (0.83) lies 0.60; raised to 0.7 for safety, which refused none of 524 good poses. It
    was 0.5 until two mirrored poses of one factory motor had passed at 0.79; those the check of
    free space refuses now."""
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    probability: ProbabilityConfig = field(default_factory=ProbabilityConfig)

    def __post_init__(self) -> None:
        _require_positive(self, ("min_motor_points", "min_judged_points", "max_bolt_sigma_mm"))
        _require_shares(
            self,
            (
                "max_free_space_violation",
                "min_explained",
                "min_tight",
                "min_coverage",
                "min_measured",
                "min_margin",
                "min_p_correct",
            ),
        )
