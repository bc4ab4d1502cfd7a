from __future__ import annotations

import numpy as np
import pytest

from boltpose.errors import DegenerateGeometryError, ShapeError
from boltpose.geometry.primitives import (
    fit_circle,
    plane_basis,
    refine_cylinder,
    robust_sigma,
    tukey_weights,
)
from boltpose.geometry.transforms import angle_between_rad


def arc(centre, radius, span_rad, count, rng, noise=0.05):
    angle = rng.uniform(0, span_rad, count)
    normals = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.asarray(centre) + (radius + rng.normal(scale=noise, size=(count, 1))) * normals
    return points, normals


def tube(rng, radius=38.0, half_length=40.0, count=4000, noise=0.05):
    angle = rng.uniform(0, 2 * np.pi, count)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    points = (radius + rng.normal(scale=noise, size=(count, 1))) * normals
    points[:, 2] = rng.uniform(-half_length, half_length, count)
    return points, normals


def test_tukey_weights_fall_from_one_to_zero() -> None:
    np.testing.assert_allclose(
        tukey_weights(np.array([0.0, 0.5, 1.0, -1.0, 5.0]), 1.0), [1.0, 0.5625, 0, 0, 0]
    )


def test_robust_sigma_of_noise_with_outliers() -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(scale=2.0, size=5000), np.full(500, 100.0)])
    assert robust_sigma(values) == pytest.approx(2.0, rel=0.2)


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0.6, -0.8, 0), (0.48, 0.6, 0.64)])
def test_plane_basis_completes_the_axis_to_a_right_handed_frame(axis) -> None:
    frame = np.vstack([plane_basis(axis), axis])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_a_circle_is_found_among_outliers() -> None:
    rng = np.random.default_rng(1)
    points, normals = arc((10, -5), 25.0, np.pi, 400, rng)
    junk = rng.uniform(-60, 60, (600, 2))
    turn = rng.uniform(0, 2 * np.pi, 600)
    fit = fit_circle(
        np.concatenate([points, junk]),
        np.concatenate([normals, np.column_stack([np.cos(turn), np.sin(turn)])]),
        rng=rng,
        radius_range_mm=(10, 50),
    )
    np.testing.assert_allclose(fit.centre_mm, (10, -5), atol=0.05)
    assert fit.radius_mm == pytest.approx(25.0, abs=0.05)
    assert fit.inliers[:400].mean() > 0.99
    assert fit.inliers[400:].mean() < 0.05


def test_a_hole_is_no_circle_seen_from_outside() -> None:
    rng = np.random.default_rng(1)
    points, normals = arc((0, 0), 25.0, 2 * np.pi, 400, rng)
    with pytest.raises(DegenerateGeometryError, match="radius 10 to 50 mm"):
        fit_circle(points, -normals, rng=rng, radius_range_mm=(10, 50))


def test_a_straight_edge_is_no_circle() -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-30, 30, 300), rng.normal(scale=0.02, size=300)])
    normals = np.tile([0.0, 1.0], (300, 1))
    with pytest.raises(DegenerateGeometryError):
        fit_circle(points, normals, rng=rng, radius_range_mm=(10, 50))


def test_circle_of_wrong_shapes_is_refused() -> None:
    with pytest.raises(ShapeError, match="same shape"):
        fit_circle(
            np.zeros((5, 2)),
            np.zeros((4, 2)),
            rng=np.random.default_rng(0),
            radius_range_mm=(1, 2),
        )


def test_a_cylinder_is_refined_onto_its_points() -> None:
    rng = np.random.default_rng(2)
    points, normals = tube(rng)
    start = np.array([0.02, -0.015, 1.0])
    fit = refine_cylinder(
        points, normals, start / np.linalg.norm(start), np.array([0.3, -0.2, 10.0]), 38.3
    )
    assert np.rad2deg(angle_between_rad(fit.axis, [0, 0, 1])) < 0.01
    assert fit.radius_mm == pytest.approx(38.0, abs=0.01)
    np.testing.assert_allclose(fit.centre_mm[:2], 0.0, atol=0.02)
    assert fit.sigma_mm == pytest.approx(0.05, rel=0.2)


def test_the_cylinders_axis_sigma_is_of_the_size_of_its_errors() -> None:
    errors, sigmas = [], []
    for seed in range(15):
        points, normals = tube(np.random.default_rng(seed), noise=0.08, count=1500)
        fit = refine_cylinder(points, normals, np.array([0.0, 0, 1]), np.zeros(3), 38.0)
        errors.append(float(angle_between_rad(fit.axis, [0, 0, 1])))
        sigmas.append(fit.axis_sigma_rad)
    # two directions: the root mean square of the angle is sqrt(2) sigma
    ratio = np.sqrt(np.mean(np.square(errors)) / 2) / np.mean(sigmas)
    assert 0.4 < ratio < 1.6


def test_a_short_ring_does_not_fix_the_axis() -> None:
    rng = np.random.default_rng(3)
    points, normals = tube(rng, half_length=1e-4)
    with pytest.raises(DegenerateGeometryError, match="do not fix its axis"):
        refine_cylinder(points, normals, np.array([0.0, 0, 1]), np.zeros(3), 38.0)


def test_no_points_near_the_cylinder_is_an_error() -> None:
    points, normals = tube(np.random.default_rng(3))
    with pytest.raises(DegenerateGeometryError, match="only 0 points"):
        refine_cylinder(points, normals, np.array([0.0, 0, 1]), np.zeros(3), 20.0)
