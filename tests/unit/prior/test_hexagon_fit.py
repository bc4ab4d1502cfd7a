from __future__ import annotations

import numpy as np
import pytest

from boltpose.arrays import FloatArray
from boltpose.prior.head_fit import HeadFitConfig, fit_head
from boltpose.prior.hexagon_fit import HexagonFit, fit_hexagon


def hexagon(
    turn_rad: float, faces: tuple[int, ...] = (0, 1, 2, 3, 4, 5), *, smear_rad: float = 0.3
) -> tuple[FloatArray, FloatArray]:
    """Points on a hexagon of inner radius 5 about (2, -1), normals turned at corners."""
    rng = np.random.default_rng(0)
    points, normals = [], []
    for face in faces:
        angle = turn_rad + face * np.pi / 3
        normal, tangent = (
            np.array([np.cos(angle), np.sin(angle)]),
            np.array([-np.sin(angle), np.cos(angle)]),
        )
        along = rng.uniform(-2.88, 2.88, 25)
        depth = 5 + rng.normal(scale=0.04, size=25)
        points.append(np.array([2.0, -1.0]) + depth[:, None] * normal + along[:, None] * tangent)
        bent = angle + smear_rad * (along / 2.88) ** 3
        normals.append(np.column_stack([np.cos(bent), np.sin(bent)]))
    return np.concatenate(points), np.concatenate(normals)


def fit(points: FloatArray, normals: FloatArray) -> HexagonFit | None:
    return fit_hexagon(points, normals, np.ones(len(points)), np.array([2.4, -0.8]), 5.3, 0.3)


@pytest.mark.parametrize("turn_deg", [0, 7, 15, 29, 30, 31, 55])
def test_centre_whatever_the_turn(turn_deg: float) -> None:
    found = fit(*hexagon(np.deg2rad(turn_deg)))
    assert found is not None
    np.testing.assert_allclose(found.centre_mm, (2, -1), atol=0.03)
    assert found.radius_mm == pytest.approx(5.0, abs=0.03)
    assert found.explained > 0.95


def test_half_a_hexagon_is_enough() -> None:
    found = fit(*hexagon(0.2, (0, 1, 2, 3)))
    assert found is not None
    np.testing.assert_allclose(found.centre_mm, (2, -1), atol=0.06)


def test_two_faces_are_not() -> None:
    assert fit(*hexagon(0.2, (0, 1))) is None


@pytest.mark.parametrize("is_hexagon", [True, False])
def test_the_kind_of_flank_is_told_apart(is_hexagon: bool) -> None:
    if is_hexagon:
        xy, normals = hexagon(0.4)
    else:
        angle = np.random.default_rng(1).uniform(0, 2 * np.pi, 150)
        normals = np.column_stack([np.cos(angle), np.sin(angle)])
        xy = np.array([2.0, -1.0]) + 5 * normals
    heights = np.random.default_rng(2).uniform(-3.0, -0.3, len(xy))
    found = fit_head(
        np.column_stack([xy, heights]),
        np.column_stack([normals, np.zeros(len(xy))]),
        np.array([2.5, -0.5]),
        HeadFitConfig(),
    )
    assert found is not None
    assert found.is_hexagon is is_hexagon
    np.testing.assert_allclose(found.centre_mm, (2, -1), atol=0.03)
    assert found.radius_mm == pytest.approx(5.0, abs=0.03)
