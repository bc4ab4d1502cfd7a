"""Hand-made records: small, valid, and different in every field."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.geometry.transforms import Transform
from boltpose.schema import Alignment, Prior, PriorBolt, Registration, Side


def prior_bolt(bolt_id: str = "T1", *, seed: int = 1, is_sure: bool = True) -> PriorBolt:
    """A bolt somewhere within 50 mm, its pose drawn from the seed."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(-50, 50, 3)
    return PriorBolt(
        id=bolt_id,
        side=Side.TOP if bolt_id.startswith("T") else Side.BOTTOM,
        prior_from_bolt=Transform.from_parts(
            "prior", "bolt", Rotation.random(rng=rng).as_matrix(), position
        ),
        cluster_centre=position + 0.4,
        head_diameter_mm=10.0,
        head_height_mm=4.0,
        point_count=200,
        class_probability=0.97,
        head_fit_support=60.0,
        sigma_lateral_mm=0.06,
        sigma_axial_mm=0.05,
        confidence=0.9,
        is_sure=is_sure,
        remarks=() if is_sure else ("little flank",),
    )


def prior(*bolts: PriorBolt, seed: int = 0) -> Prior:
    """A prior of 500 random points, float32-exact as files are."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Prior(
        name="motor",
        points=rng.uniform(-60, 60, (500, 3)).astype(np.float32).astype(np.float64),
        normals=normals.astype(np.float32).astype(np.float64),
        labels=rng.integers(1, 7, 500).astype(np.uint8),
        bolts=bolts or (prior_bolt("T1"), prior_bolt("B1", seed=2, is_sure=False)),
        alignment=Alignment(
            prior_from_motor=Transform.from_parts(
                "prior", "motor", Rotation.random(rng=rng).as_matrix(), (1.0, 2.0, 3.0)
            ),
            axis_spread_rad=0.05,
            axis_sigma_rad=0.0005,
            normal_count=20000,
            inlier_ratio=0.8,
            has_solenoid=True,
        ),
        provenance={"source": "motor.ply", "version": "0"},
    )


def registration(camera_from_prior: Transform, *, seed: int = 3) -> Registration:
    """A converged registration with a full, positive definite covariance."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6)) * np.array([2e-4, 2e-4, 2e-4, 0.05, 0.05, 0.05])[:, None]
    return Registration(
        camera_from_prior=camera_from_prior,
        converged=True,
        rms_mm=0.08,
        inlier_ratio=0.9,
        covariance=root @ root.T,
        centre_mm=np.array([10.0, -20.0, 700.0]),
        runner_up_score=0.2,
        score=0.9,
    )
