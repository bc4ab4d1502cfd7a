"""Frozen records handed between stages; no stage passes dicts or tuples of five."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray, UInt8Array, as_points, freeze
from boltpose.errors import ShapeError
from boltpose.geometry.transforms import Transform


class Part(IntEnum):
    """Classes of points; the numbers are the labels in files."""

    BACKGROUND = 0
    MAIN_HOUSING = 1
    CONNECTOR = 2
    SOLENOID = 3
    ELECTRICAL_CONNECTOR = 4
    GEAR = 5
    BOLT = 6


class Side(StrEnum):
    """Which way a bolt's head looks along the motor's z axis."""

    TOP = "top"
    """Out of the head is +z of frame `motor`."""
    BOTTOM = "bottom"
    """Out of the head is -z of frame `motor`."""


class Visibility(StrEnum):
    """How much of a bolt the camera saw; the pose of a hidden bolt is inferred from the prior."""

    VISIBLE = "visible"
    PARTIAL = "partial"
    HIDDEN = "hidden"


class BoltState(StrEnum):
    """What the camera says about a bolt that the prior promises."""

    CONFIRMED = "confirmed"
    """The head was measured where it should be."""
    UNSEEN = "unseen"
    """The camera saw too little of the place to say anything."""
    CONTRADICTED = "contradicted"
    """The place was measured, and something else is there: no screwdriver must go there."""


class Status(StrEnum):
    """The verdict on one scan."""

    OK = "ok"
    REFUSED = "refused"


class Check(StrEnum):
    """What a refusal is about, the most telling first; stable codes for robots, logs and tests."""

    NO_MOTOR = "no_motor"
    """Nothing, or next to nothing, in the scan looks like a motor."""
    TOO_FEW_POINTS = "too_few_points"
    """Part of a motor, but too little of it to register."""
    UNKNOWN_MOTOR = "unknown_motor"
    """None of the known motors fits, or two fit equally well."""
    VIEWS_DISAGREE = "views_disagree"
    """Views of one clamping put the motor in different places: it moved, or a hand-eye is wrong."""
    EXPLAINED = "wrong_motor"
    """What was taken for the motor does not lie on the posed prior: another motor, or none."""
    FREE_SPACE = "free_space_violated"
    """The camera saw through where the posed motor would be."""
    FIT = "poor_fit"
    """It lies near the prior but not on it: another size, a changed motor, a pose that is off."""
    COVERAGE = "prior_not_covered"
    """Surface of the posed motor in free view was not measured where it should be."""
    AMBIGUOUS = "ambiguous_pose"
    """A clearly different pose fits nearly as well."""
    UNCONSTRAINED = "pose_not_constrained"
    """The points leave the pose free to slide or turn, or refinement did not settle."""
    UNLIKELY = "unlikely_pose"
    """Every single check is met, but all numbers together look like those of a wrong pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """A point cloud as a sensor or a file delivered it, holes removed."""

    points: FloatArray
    """Shape (N, 3), float64, mm, finite; frame `camera` for a view, `prior` for a full scan."""
    colors: UInt8Array | None = None
    """Shape (N, 3), RGB."""
    normals: FloatArray | None = None
    """Shape (N, 3), as found in the file: neither normalised nor oriented by us."""
    labels: UInt8Array | None = None
    """Shape (N,), `Part` numbers, where the file carries them."""
    pixels: IntArray | None = None
    """Shape (N, 2), row and column of each point, where the file is organised."""
    grid_shape: tuple[int, int] | None = None
    """Rows and columns of the organised file."""
    source: str = "memory"
    """Where it came from, for messages and provenance."""

    def __post_init__(self) -> None:
        points = as_points(self.points, "points", at_least=0)
        object.__setattr__(self, "points", freeze(points))
        for name in ("colors", "normals", "labels", "pixels"):
            array = getattr(self, name)
            if array is None:
                continue
            if len(array) != len(points):
                raise ShapeError(f"{name} must have {len(points)} rows, got {len(array)}")
            object.__setattr__(self, name, freeze(np.asarray(array)))

    def __len__(self) -> int:
        return len(self.points)

    def subset(self, index: IntArray | BoolArray) -> Scan:
        """Keep the points of an index or mask, all attributes with them."""

        def pick(array: Any) -> Any:
            return None if array is None else array[index]

        return Scan(
            points=self.points[index],
            colors=pick(self.colors),
            normals=pick(self.normals),
            labels=pick(self.labels),
            pixels=pick(self.pixels),
            grid_shape=self.grid_shape,
            source=self.source,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PriorBolt:
    """One bolt of a motor as its full scan shows it.

    Frame `bolt`: origin `head_top` (on the axis, on the top face of the head, where the tool
    lands), +z out of the head, x and y completing a proper rotation.
    """

    id: str
    """Unique in its prior and stable for the same scan, for example `T1`, `B2`."""
    side: Side
    prior_from_bolt: Transform
    cluster_centre: FloatArray
    """Shape (3,), mm, frame `prior`: mean of the bolt's points, the paper's position."""
    head_diameter_mm: float
    """2 r of the flank fit: the spanner size of a hexagon, the diameter of a round head."""
    head_height_mm: float
    """From the top face down to where the points of the head end."""
    point_count: int
    class_probability: float
    """Mean probability of class bolt over the cluster, 0 to 1."""
    head_fit_support: float
    """How much flank, all around, carries the axis; see `prior.head_fit`."""
    sigma_lateral_mm: float
    sigma_axial_mm: float
    is_sure: bool
    """False: a person should look at this bolt once before production."""
    remarks: tuple[str, ...] = ()
    """Why it is unsure, or that a person placed it."""
    confidence: float = 1.0
    """Probability that this is a bolt and at most 0.5 mm beside its true axis, 0 to 1; see
    `prior.confidence`. 1 where a person or a drawing says so."""
    name: str = ""
    """What people call it, for example `solenoid upper`; empty: its id is its name."""
    tool: str = ""
    """The tool that turns it, in the cell's own words, for example `hex 8`; empty: not said."""
    order: int | None = None
    """Its turn when bolts are taken out, from 1; None: after all that have one."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Alignment:
    """The motor's axes found in its full scan (paper, section 3.5)."""

    prior_from_motor: Transform
    axis_spread_rad: float
    """Robust 1 sigma of the housing normals against the plane they should lie in."""
    axis_sigma_rad: float
    """1 sigma of the z axis that follows from it."""
    normal_count: int
    """Housing normals on the Gauss-sphere plane."""
    inlier_ratio: float
    has_solenoid: bool
    """False: y could not be taken from a solenoid, the roll about z is arbitrary."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prior:
    """What is known about a motor before it is clamped."""

    name: str
    points: FloatArray
    """Shape (N, 3), mm, frame `prior`, thinned to about 1 mm."""
    normals: FloatArray
    """Shape (N, 3), unit, outward."""
    labels: UInt8Array
    """Shape (N,), `Part` numbers."""
    bolts: tuple[PriorBolt, ...]
    alignment: Alignment
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """Source file and hash, models, settings, version; JSON-ready."""

    def bolt(self, bolt_id: str) -> PriorBolt:
        """Return the bolt of that id; raises `KeyError` with the ids there are."""
        for bolt in self.bolts:
            if bolt.id == bolt_id:
                return bolt
        raise KeyError(f"no bolt '{bolt_id}', there are {[bolt.id for bolt in self.bolts]}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Registration:
    """The pose of a prior in a view, with what speaks for it."""

    camera_from_prior: Transform
    converged: bool
    rms_mm: float
    """Of the inlier point-to-plane residuals. Bounded by the pair distance: no measure of truth."""
    inlier_ratio: float
    """Share of the motor points that found a partner."""
    covariance: FloatArray
    """Shape (6, 6), of a small motion in frame `camera` about `centre_mm`: rotation vector
    (rad) first, translation (mm) second."""
    centre_mm: FloatArray
    """Shape (3,), frame `camera`."""
    runner_up_score: float
    """Score of the best clearly different pose, on the scale of `score`."""
    score: float
    """Score by which poses were ranked, larger is better."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether a pose may be used, and every number the decision rests on."""

    status: Status
    failed: tuple[Check, ...]
    reasons: tuple[str, ...]
    """One sentence per failed check: what was found and what was wanted."""
    scores: Mapping[str, float]
    thresholds: Mapping[str, float]
    p_correct: float = 0.0
    """Probability that every bolt is at most 2 mm and 2 degrees off as the camera sees the motor, 0
    to 1; 0 without a pose. The hand-eye's error is not in it: that is in every bolt's sigmas."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HandEyeError:
    """How well `base_from_camera` is known: a small random motion about the camera's origin."""

    rotation_sigma_rad: float
    """1 sigma about each axis."""
    translation_sigma_mm: float
    """1 sigma along each axis."""

    def __post_init__(self) -> None:
        for name in ("rotation_sigma_rad", "translation_sigma_mm"):
            value = getattr(self, name)
            if not 0 <= value < float("inf"):  # written so that NaN fails too
                raise ValueError(f"{name} must be finite and >= 0, got {value}")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExtraHead:
    """What looks like the head of a bolt where the prior has none.

    A hint for a person: it may be a screw of the clamp, see `registration.extra_heads`.
    """

    head_top_mm: FloatArray
    """Shape (3,), in the frame of the result: the middle of its top face."""
    diameter_mm: float
    height_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class VariantScore:
    """How one of several known motors fits a scan."""

    name: str
    status: Status
    p_correct: float
    score: float
    """Share, 0 to 1, of the motor points that agree with it; -inf if no pose was found. A motor
    that was compared but not registered in full is `refused` with `p_correct` 0."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LocatedBolt:
    """One bolt in the robot's frame (`base`), or in `camera` when no hand-eye was given."""

    id: str
    side: Side
    frame_from_bolt: Transform
    """`base_from_bolt` or `camera_from_bolt`."""
    visible_fraction: float
    """Share of the head's outer surface that the camera measured, 0 to 1."""
    visibility: Visibility
    sigma_lateral_mm: float
    """1 sigma beside the axis, the larger of the two directions."""
    sigma_axial_mm: float
    sigma_axis_rad: float
    covariance_mm2: FloatArray
    """Shape (3, 3), of `head_top`, same frame as the pose; the hand-eye's error is in it only if
    `HandEyeError` was given."""
    head_diameter_mm: float
    head_height_mm: float
    confidence: float
    """That this is a bolt where it is said to be, 0 to 1; see `PriorBolt.confidence`."""
    is_sure: bool
    cluster_centre: FloatArray
    """Shape (3,), mm, same frame as the pose: the paper's position."""
    remarks: tuple[str, ...] = ()
    state: BoltState = BoltState.UNSEEN
    state_reason: str = ""
    """One sentence on what was seen instead; empty unless contradicted."""
    p_tool_fits: float | None = None
    """Probability that the given tool lands on the bolt, 0 to 1; None if no tool was given."""
    name: str = ""
    """As in the prior, like the next two; see `PriorBolt`."""
    tool: str = ""
    order: int | None = None

    @property
    def head_top(self) -> FloatArray:
        """Shape (3,), mm: the point on the axis at the top of the head, where the tool lands."""
        return self.frame_from_bolt.translation_mm

    @property
    def position(self) -> FloatArray:
        """Shape (3,), mm: the head's centre, on the axis half way up the head."""
        return self.head_top - 0.5 * self.head_height_mm * self.axis

    @property
    def axis(self) -> FloatArray:
        """Shape (3,), unit, out of the head."""
        return self.frame_from_bolt.z_axis


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LocateResult:
    """Every bolt of the clamped motor, or the reasons why no pose is given."""

    verdict: Verdict
    frame: str
    """`base`, or `camera` when no hand-eye was given."""
    bolts: tuple[LocatedBolt, ...]
    """Empty when refused."""
    registration: Registration | None
    """The candidate pose, kept on refusal for diagnosis; None when not even one was found."""
    prior_name: str
    base_from_camera: Transform | None = None
    """The hand-eye that was used."""
    motor_mask: BoolArray | None = None
    """Shape (N,), which points of the scan lie on the posed prior; None unless
    `LocateConfig.label_scan` asked for it."""
    extra_heads: tuple[ExtraHead, ...] = ()
    """Heads the camera saw that the prior does not know."""
    variants: tuple[VariantScore, ...] = ()
    """The known motors that were tried, best first; empty if the motor was given."""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_ok(self) -> bool:
        """True if the poses may be used."""
        return self.verdict.status is Status.OK
