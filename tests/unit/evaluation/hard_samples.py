"""Small hard scenes and records, from closed formulas."""

from __future__ import annotations

import numpy as np

from boltpose.evaluation.hard_records import HardCase, HardMotor
from boltpose.evaluation.hard_scenes import HardScene
from boltpose.evaluation.reman18 import TrueBolt
from boltpose.registration.evidence import Evidence
from boltpose.schema import Side
from tests.unit.registration.scenes import BOLTS, pose, view

TRUTH = pose(turn=(0.4, 1.9, 0.3))
CAMERA_MATRIX = np.array([[500.0, 0.0, 160.0], [0.0, 500.0, 130.0], [0.0, 0.0, 1.0]])
SHAPE = (260, 320)


def scene() -> HardScene:
    """The made-up motor before a wall, as a depth image."""
    points, is_motor = view(TRUTH, step=0.5)
    image = points @ CAMERA_MATRIX.T
    column, row = np.rint(image[:, :2] / image[:, 2:]).astype(int).T
    inside = (row >= 0) & (row < SHAPE[0]) & (column >= 0) & (column < SHAPE[1])
    order = np.flatnonzero(inside)[np.argsort(-points[inside, 2], kind="stable")]
    depth, mask = np.zeros(SHAPE), np.zeros(SHAPE, dtype=bool)
    depth[row[order], column[order]] = points[order, 2]
    mask[row[order], column[order]] = is_motor[order]
    return HardScene(
        name="made up",
        depth_mm=depth,
        is_motor=mask,
        camera_matrix=CAMERA_MATRIX,
        camera_from_prior=TRUTH,
    )


def true_bolts() -> tuple[TrueBolt, ...]:
    return tuple(
        TrueBolt(
            id=number,
            head="hex",
            side=Side.TOP if axis[2] > 0 else Side.BOTTOM,
            head_top_mm=np.array(top),
            axis=np.array(axis),
            head_diameter_mm=10.0,
        )
        for number, (top, axis) in enumerate(BOLTS.values())
    )


def evidence(quality: float) -> Evidence:
    """Evidence that is better the nearer `quality` is to 1."""
    return Evidence(
        motor_points=5000,
        free_space_violation=0.0,
        explained=0.99,
        tight=quality,
        weakest_tight=quality,
        sunk=0.05 * (1.0 - quality),
        coverage=0.9,
        judged_points=8000,
        measured=0.9,
        margin=0.4,
        bolt_sigma_mm=0.12,
        converged=True,
    )


def case(
    quality: float | None,
    error_mm: float,
    *,
    pose_kind: str = "located",
    scene_kind: str = "as it is",
    is_settled: bool = True,
) -> HardCase:
    return HardCase(
        scene=scene_kind,
        pose=pose_kind,
        size=0.0,
        is_settled=is_settled,
        view=0,
        prior="motor_000",
        worst_bolt_mm=error_mm,
        rotation_deg=0.0,
        evidence=None if quality is None else evidence(quality),
    )


def motors() -> tuple[HardMotor, ...]:
    """A chooser and a tester, well separable."""
    rng = np.random.default_rng(0)
    records = []
    for number, is_chooser in enumerate((True, False)):
        good = [case(float(q), 0.1) for q in rng.uniform(0.99, 1.0, 30)]
        wrong = [
            case(float(q), 5.0, pose_kind="slid, raw", is_settled=False)
            for q in rng.uniform(0.1, 0.9, 60)
        ]
        other = [case(None, float("inf"), scene_kind="other size")]
        starved = [case(0.95, 0.2, scene_kind="hidden 95%")]
        between = [case(0.5, 1.5, pose_kind="moved, raw", is_settled=False)]
        records.append(
            HardMotor(
                fingerprint="0",
                data_set="reman18",
                motor=f"motor_{number:03d}",
                family="even" if is_chooser else "odd",
                is_chooser=is_chooser,
                changes=((0, ("bolt_lost",)),),
                cases=(*good, *wrong, *other, *starved, *between),
            )
        )
    return tuple(records)
