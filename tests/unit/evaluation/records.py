"""Small true motors, found bolts and results to hold the metrics against."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from boltpose.evaluation.reman18 import TrueBolt, TrueMotor, TrueView, TrueVisibility
from boltpose.geometry.transforms import Transform
from boltpose.schema import (
    Alignment,
    LocatedBolt,
    LocateResult,
    Prior,
    PriorBolt,
    Registration,
    Side,
    Status,
    Verdict,
    Visibility,
)

TOPS = np.array([[40.0, 0, 60], [0, 40, 60], [-40, 0, 60], [0, -40, -70]])


def shift(target: str, source: str, offset: tuple[float, float, float]) -> Transform:
    return Transform.from_parts(target, source, np.eye(3), offset)


def turn_x(target: str, source: str, angle_rad: float) -> Transform:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    rotation = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return Transform.from_parts(target, source, rotation, (0, 0, 0))


def true_bolts() -> tuple[TrueBolt, ...]:
    return tuple(
        TrueBolt(
            id=i,
            head="hex",
            side=Side.TOP if top[2] > 0 else Side.BOTTOM,
            head_top_mm=top,
            axis=np.array([0.0, 0.0, np.sign(top[2])]),
            head_diameter_mm=10.0,
        )
        for i, top in enumerate(TOPS)
    )


def true_view(
    *, camera_from_prior: Transform, index: int = 0, visible: tuple[int, ...] = (0, 1)
) -> TrueView:
    return TrueView(
        motor="motor_000",
        index=index,
        camera_from_prior=camera_from_prior,
        base_from_camera=shift("base", "camera", (900.0, 100.0, 50.0)),
        camera_matrix=np.array([[100.0, 0, 20], [0, 100.0, 15], [0, 0, 1]]),
        depth_scale_mm=0.02,
        clamp="vice",
        visibility={
            i: TrueVisibility(is_visible=i in visible, fraction=0.4 if i in visible else 0.0)
            for i in range(len(TOPS))
        },
        depth_path=Path("depth.png"),
        label_path=Path("label.png"),
        hand_eye_path=Path("hand_eye.yaml"),
    )


def true_motor(name: str, family: str, views: tuple[TrueView, ...]) -> TrueMotor:
    return TrueMotor(
        name=name,
        family=family,
        prior_from_motor=Transform.identity("prior", "motor"),
        bolts=true_bolts(),
        views=views,
        housing_radius_mm=35.0,
        housing_length_mm=100.0,
        scan_path=Path("prior.ply"),
    )


def bolt_pose(top: np.ndarray, side: Side) -> Transform:
    rotation = np.eye(3) if side is Side.TOP else np.diag([1.0, -1.0, -1.0])
    return Transform.from_parts("prior", "bolt", rotation, top)


def prior_bolt(
    bolt_id: str, top: np.ndarray, side: Side = Side.TOP, *, is_sure: bool = True
) -> PriorBolt:
    return PriorBolt(
        id=bolt_id,
        side=side,
        prior_from_bolt=bolt_pose(top, side),
        cluster_centre=top,
        head_diameter_mm=10.5,
        head_height_mm=4.0,
        point_count=200,
        class_probability=0.9,
        head_fit_support=50.0,
        sigma_lateral_mm=0.1,
        sigma_axial_mm=0.1,
        is_sure=is_sure,
    )


def perfect_prior(name: str = "motor_000") -> Prior:
    points = np.vstack([TOPS, TOPS + 1])
    return Prior(
        name=name,
        points=points,
        normals=np.tile([0.0, 0, 1], (len(points), 1)),
        labels=np.full(len(points), 6, dtype=np.uint8),
        bolts=tuple(
            prior_bolt(f"B{bolt.id}", bolt.head_top_mm, bolt.side) for bolt in true_bolts()
        ),
        alignment=Alignment(
            prior_from_motor=Transform.identity("prior", "motor"),
            axis_spread_rad=0.01,
            axis_sigma_rad=0.001,
            normal_count=100,
            inlier_ratio=0.9,
            has_solenoid=True,
        ),
    )


def registration(camera_from_prior: Transform) -> Registration:
    return Registration(
        camera_from_prior=camera_from_prior,
        converged=True,
        rms_mm=0.1,
        inlier_ratio=0.9,
        covariance=np.eye(6) * 1e-6,
        centre_mm=np.zeros(3),
        runner_up_score=0.1,
        score=0.9,
    )


def located(
    prior: Prior,
    camera_from_prior: Transform,
    base_from_camera: Transform | None,
    *,
    status: Status = Status.OK,
    scores: Mapping[str, float] | None = None,
) -> LocateResult:
    frame_from_prior = (
        camera_from_prior if base_from_camera is None else base_from_camera @ camera_from_prior
    )
    bolts = tuple(
        LocatedBolt(
            id=bolt.id,
            side=bolt.side,
            frame_from_bolt=frame_from_prior @ bolt.prior_from_bolt,
            visible_fraction=0.5,
            visibility=Visibility.PARTIAL,
            sigma_lateral_mm=0.1,
            sigma_axial_mm=0.1,
            sigma_axis_rad=0.002,
            covariance_mm2=np.eye(3) * 0.01,
            head_diameter_mm=bolt.head_diameter_mm,
            head_height_mm=bolt.head_height_mm,
            confidence=bolt.confidence,
            is_sure=bolt.is_sure,
            cluster_centre=frame_from_prior.apply(bolt.cluster_centre),
        )
        for bolt in prior.bolts
    )
    return LocateResult(
        verdict=Verdict(
            status=status,
            failed=(),
            reasons=() if status is Status.OK else ("it does not fit",),
            scores=scores or {"explained": 0.9},
            thresholds={"explained": 0.5},
        ),
        frame="camera" if base_from_camera is None else "base",
        bolts=bolts if status is Status.OK else (),
        registration=registration(camera_from_prior),
        prior_name=prior.name,
    )
