"""Hand-made results of `locate`: a cube for a motor, one bolt of every kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from boltpose.geometry.transforms import Transform
from boltpose.schema import (
    Check,
    LocatedBolt,
    LocateResult,
    Part,
    Prior,
    Scan,
    Side,
    Status,
    Verdict,
    Visibility,
)
from tests.support import records

CAMERA_FROM_PRIOR = Transform.from_parts(
    "camera", "prior", np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 700.0)
)
BASE_FROM_CAMERA = Transform.from_parts(
    "base", "camera", np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]]), (500.0, 20.0, 900.0)
)


def cube_prior(edge_mm: float = 100.0, step_mm: float = 2.0) -> Prior:
    """A cube around the origin with a seen, a partly seen and a hidden, unsure bolt."""
    ticks = np.arange(-edge_mm / 2, edge_mm / 2 + step_mm / 2, step_mm)
    u, v = (grid.ravel() for grid in np.meshgrid(ticks, ticks))
    faces, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.insert(np.stack([u, v], axis=1), axis, sign * edge_mm / 2, axis=1)
            faces.append(face)
            normals.append(np.tile(sign * np.eye(3)[axis], (len(face), 1)))
    points = np.vstack(faces)
    labels = np.full(len(points), Part.MAIN_HOUSING, dtype=np.uint8)
    half = edge_mm / 2
    labels[np.linalg.norm(points - (20, 20, half), axis=1) < 6] = Part.BOLT
    bolts = [
        _bolt("T1", Side.TOP, (20, 20, half)),
        _bolt("T2", Side.TOP, (-20, -20, half)),
        _bolt("B1", Side.BOTTOM, (15, -15, -half), is_sure=False),
    ]
    return replace(
        records.prior(*bolts),
        name="cube",
        points=points,
        normals=np.vstack(normals),
        labels=labels,
        alignment=replace(
            records.prior().alignment, prior_from_motor=Transform.identity("prior", "motor")
        ),
    )


def cube_scan(prior: Prior) -> Scan:
    """What a camera sees of the cube of `cube_prior`: its top face and a table beneath."""
    camera = CAMERA_FROM_PRIOR.apply(prior.points)
    top = camera[prior.points[:, 2] >= prior.points[:, 2].max() - 1e-6]
    ticks = np.arange(-120.0, 121.0, 4.0)
    x, y = (grid.ravel() for grid in np.meshgrid(ticks, ticks))
    table = np.stack([x, y, np.full_like(x, 750.0)], axis=1)
    return Scan(points=np.vstack([top, table]), source="cube.ply")


def located(
    prior: Prior, base_from_camera: Transform | None = BASE_FROM_CAMERA, *, count: int = 0
) -> LocateResult:
    """An accepted result; `count` scan points make its mask."""
    pose = CAMERA_FROM_PRIOR if base_from_camera is None else base_from_camera @ CAMERA_FROM_PRIOR
    levels = (Visibility.VISIBLE, Visibility.PARTIAL, Visibility.HIDDEN)
    fractions = (0.61, 0.17, 0.0)
    return LocateResult(
        verdict=Verdict(
            status=Status.OK,
            failed=(),
            reasons=(),
            scores={"coverage": 0.93, "free_space_violation": 0.001},
            thresholds={"coverage": 0.87, "free_space_violation": 0.01},
        ),
        frame=pose.target,
        bolts=tuple(
            LocatedBolt(
                id=bolt.id,
                side=bolt.side,
                frame_from_bolt=pose @ bolt.prior_from_bolt,
                visible_fraction=fraction,
                visibility=level,
                sigma_lateral_mm=0.11,
                sigma_axial_mm=0.22,
                sigma_axis_rad=np.radians(0.33),
                covariance_mm2=np.diag([0.0121, 0.0121, 0.0484]),
                head_diameter_mm=bolt.head_diameter_mm,
                head_height_mm=bolt.head_height_mm,
                confidence=bolt.confidence,
                is_sure=bolt.is_sure,
                cluster_centre=pose.apply(bolt.cluster_centre),
                remarks=bolt.remarks,
            )
            for bolt, level, fraction in zip(prior.bolts, levels, fractions, strict=True)
        ),
        registration=records.registration(CAMERA_FROM_PRIOR),
        prior_name=prior.name,
        base_from_camera=base_from_camera,
        motor_mask=np.arange(count) < count // 2 if count else None,
        provenance={"version": "0"},
    )


def refused(prior: Prior, *, has_candidate: bool = True) -> LocateResult:
    """A refused result: no bolts, two reasons, one score that could not be measured."""
    return LocateResult(
        verdict=Verdict(
            status=Status.REFUSED,
            failed=(Check.FREE_SPACE, Check.AMBIGUOUS),
            reasons=(
                "free_space_violation 0.06, wanted at most 0.01",
                "margin 0.01, wanted at least 0.03",
                "converged 0, wanted 1",
            ),
            scores={"free_space_violation": 0.06},
            thresholds={"free_space_violation": 0.01, "margin": 0.03},
        ),
        frame="base",
        bolts=(),
        registration=records.registration(CAMERA_FROM_PRIOR) if has_candidate else None,
        prior_name=prior.name,
        base_from_camera=BASE_FROM_CAMERA,
    )


def _bolt(bolt_id: str, side: Side, position: tuple[float, float, float], *, is_sure: bool = True):
    rotation = np.eye(3) if side is Side.TOP else np.diag([1.0, -1.0, -1.0])
    return replace(
        records.prior_bolt(bolt_id, is_sure=is_sure),
        side=side,
        prior_from_bolt=Transform.from_parts("prior", "bolt", rotation, position),
        cluster_centre=np.array(position),
    )
