"""The must-be-refused set: which scans it holds, how they are made, what each must lead to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from boltpose.arrays import BoolArray
from boltpose.errors import EmptyScanError
from boltpose.evaluation import decoys
from boltpose.evaluation.reman18 import TrueMotor, TrueView, read_pixel_labels
from boltpose.schema import Scan

SEED = 20_260_801
"""Every random number of the set follows from it, the motor and the view."""
MAX_NOISE_POINTS = 200_000


class CaseKind(StrEnum):
    """What is in front of the camera."""

    CLAMP_ONLY = "clamp_only"
    """The view without its motor: the clamp, with a hole where nothing was measured."""
    EMPTY_CLAMP = "empty_clamp"
    """The same with the hole closed by surface like the clamp around it."""
    PLAIN_TABLE = "plain_table"
    """One plane."""
    CYLINDER = "cylinder"
    """A plain cylinder as big as the housing in the motor's place."""
    OTHER_FAMILY = "other_family"
    """A motor of another family than the prior's."""
    OTHER_SIZE = "other_size"
    """A motor of the prior's family in another size."""
    MIRRORED = "mirrored"
    """The right motor, mirrored."""
    NOISE_IN_BOX = "noise_in_box"
    """Points spread evenly in the box of the view."""
    NOISE_IN_DEPTH = "noise_in_depth"
    """Every ray of the view with a random depth."""
    CROP_BALL = "crop_ball"
    """The right motor, of which only a ball of 25 mm radius was measured."""
    CROP_STRIP = "crop_strip"
    """The right motor, of which only the outer 15 % along the longest extent was measured."""
    CROP_SPARSE = "crop_sparse"
    """The right motor, of which only one point in 400 was measured."""


class Expectation(StrEnum):
    """What a careful method may answer."""

    REFUSE = "refuse"
    """No pose is right."""
    RIGHT_OR_REFUSE = "right_or_refuse"
    """A pose may be found if it is the right one."""


CROPS = (CaseKind.CROP_BALL, CaseKind.CROP_STRIP, CaseKind.CROP_SPARSE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One scan to locate a prior's motor in."""

    kind: CaseKind
    prior_motor: str
    scene_motor: str
    scene_family: str
    view: int

    @property
    def expectation(self) -> Expectation:
        """What may be answered."""
        if self.kind in CROPS:
            return Expectation.RIGHT_OR_REFUSE
        return Expectation.REFUSE


def list_cases(motor: TrueMotor, others: Sequence[TrueMotor]) -> tuple[Case, ...]:
    """List the cases of one prior.

    Every other motor of another family with one view (which one depends on both numbers, so that
    all are used over the set), every other size of the family with all its views, everything
    else with every view of the motor itself; table and noise with its first.

    Args:
        motor: The prior's motor.
        others: All motors of the data set; the prior's own is skipped.

    Returns:
        The cases, in a fixed order.
    """
    cases: list[Case] = []

    def add(kind: CaseKind, scene: TrueMotor, view: TrueView) -> None:
        cases.append(
            Case(
                kind=kind,
                prior_motor=motor.name,
                scene_motor=scene.name,
                scene_family=scene.family,
                view=view.index,
            )
        )

    for other in others:
        if other.name == motor.name:
            continue
        if other.family == motor.family:
            for view in other.views:
                add(CaseKind.OTHER_SIZE, other, view)
        else:
            pick = (motor.number + other.number) % len(other.views)
            add(CaseKind.OTHER_FAMILY, other, other.views[pick])
    for kind in CaseKind:
        if kind in (CaseKind.OTHER_FAMILY, CaseKind.OTHER_SIZE):
            continue
        once = (CaseKind.PLAIN_TABLE, CaseKind.NOISE_IN_BOX, CaseKind.NOISE_IN_DEPTH)
        for view in motor.views[:1] if kind in once else motor.views:
            add(kind, motor, view)
    return tuple(cases)


def make_scan(case: Case, scene: TrueMotor, read_scan: Callable[[Path], Scan]) -> Scan:
    """Make the scan of a case; the same case gives the same points.

    Args:
        case: What to make.
        scene: The truth of `case.scene_motor`.
        read_scan: Reads a view's depth image to a scan with pixels.

    Returns:
        The scan, frame `camera`, mm.

    Raises:
        InputFileError: A file of the view cannot be read.
        EmptyScanError: The view holds nothing to make the case from.
        ValueError: `scene` is not the case's.
    """
    if scene.name != case.scene_motor:
        raise ValueError(f"the case is about {case.scene_motor}, got {scene.name}")
    view = next(view for view in scene.views if view.index == case.view)
    scan = read_scan(view.depth_path)
    if case.kind in (CaseKind.OTHER_FAMILY, CaseKind.OTHER_SIZE):
        return scan
    rng = np.random.default_rng((SEED, scene.number, case.view))
    if case.kind is CaseKind.MIRRORED:
        return decoys.mirror_scan(scan)
    if case.kind is CaseKind.NOISE_IN_BOX:
        return decoys.noise_in_box(scan, min(len(scan), MAX_NOISE_POINTS), rng)
    if case.kind is CaseKind.NOISE_IN_DEPTH:
        return decoys.noise_in_depth(scan, rng)
    if case.kind is CaseKind.PLAIN_TABLE:
        return decoys.plain_table(scan, view.camera_matrix, rng)
    if scan.pixels is None:
        raise EmptyScanError(f"{scan.source} has no pixels, wanted an organised view")
    is_motor = read_pixel_labels(view, scan.pixels) > 0
    if case.kind is CaseKind.CLAMP_ONLY:
        return decoys.keep_points(scan, ~is_motor, case.kind)
    if case.kind is CaseKind.EMPTY_CLAMP:
        return decoys.close_hole(scan, is_motor, view.camera_matrix, rng)
    if case.kind is CaseKind.CYLINDER:
        camera_from_motor = view.camera_from_prior @ scene.prior_from_motor
        return decoys.swap_for_cylinder(
            scan,
            is_motor,
            view.camera_matrix,
            centre_mm=camera_from_motor.translation_mm,
            axis=camera_from_motor.z_axis,
            radius_mm=scene.housing_radius_mm,
            length_mm=scene.housing_length_mm,
            rng=rng,
        )
    return decoys.keep_points(scan, ~is_motor | _crop(case.kind, scan, is_motor, rng), case.kind)


def _crop(kind: CaseKind, scan: Scan, is_motor: BoolArray, rng: np.random.Generator) -> BoolArray:
    """Which points of the motor stay, shape (N,)."""
    motor = scan.points[is_motor]
    if kind is CaseKind.CROP_SPARSE:
        return is_motor & (rng.random(len(is_motor)) < 1 / 400)
    if kind is CaseKind.CROP_BALL:
        centre = motor[int(rng.integers(len(motor)))]
        return is_motor & (np.linalg.norm(scan.points - centre, axis=1) < 25.0)
    centred = motor - motor.mean(axis=0)
    longest = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    height = scan.points @ longest
    return is_motor & (height >= np.quantile(height[is_motor], 0.85))
