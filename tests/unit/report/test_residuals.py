from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.geometry.transforms import Transform
from boltpose.report.residuals import BINS, FULL_MM, REACH_MM, measure_residuals, residual_tints
from tests.support import results

POSE = results.CAMERA_FROM_PRIOR


def top_face(off_mm: float) -> np.ndarray:
    """Points over the middle of the cube's top face, frame `camera`."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-30.0, 31.0, 2.0), [-10.0, 0.0, 10.0]))
    return POSE.apply(np.stack([x, y, np.full_like(x, 50.0 + off_mm)], axis=1))


@pytest.mark.parametrize("off_mm", [-1.2, -0.3, 0.0, 0.4, 1.4])
def test_the_distance_is_that_along_the_normal_on_either_side(off_mm: float) -> None:
    points = top_face(off_mm)
    found = measure_residuals(points, results.cube_prior(), POSE)

    assert list(found.rows) == list(range(len(points)))
    np.testing.assert_allclose(found.distance_mm, abs(off_mm), atol=1e-9)
    assert found.quantile_mm(0.5) == pytest.approx(abs(off_mm), abs=1e-9)
    shares = found.histogram()
    assert shares.sum() == pytest.approx(1)
    row = min(int((abs(off_mm) + 1e-9) / FULL_MM * BINS), BINS)
    assert shares[max(row - 1, 0) : row + 1].sum() == pytest.approx(1)


def test_points_that_do_not_belong_to_the_motor_are_left_out() -> None:
    far = top_face(REACH_MM + 0.2)
    near = top_face(0.1)
    found = measure_residuals(np.vstack([far, near]), results.cube_prior(), POSE)

    assert list(found.rows) == list(range(len(far), len(far) + len(near)))
    np.testing.assert_array_equal(
        found.is_near(len(far) + len(near)), [False] * len(far) + [True] * len(near)
    )


def test_a_turned_world_changes_nothing() -> None:
    prior = results.cube_prior()
    rotation = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    turn = Transform.from_parts("camera", "camera", rotation, (5.0, 6.0, 7.0))
    points = top_face(0.25)

    here = measure_residuals(points, prior, POSE)
    there = measure_residuals(turn.apply(points), prior, turn @ POSE)

    np.testing.assert_allclose(here.distance_mm, there.distance_mm, atol=1e-9)


def test_without_points_nothing_is_near() -> None:
    prior = replace(results.cube_prior())
    found = measure_residuals(np.zeros((0, 3)), prior, POSE)

    assert len(found.rows) == 0
    assert found.histogram().sum() == 0
    assert found.quantile_mm(0.5) == float("inf")


def test_colours_only_get_darker_so_that_they_read_in_grey() -> None:
    tints = residual_tints(np.linspace(0, FULL_MM, 101))
    luminance = tints @ (0.2126, 0.7152, 0.0722)

    assert (np.diff(luminance) < 0).all()
    assert luminance[0] > 0.9
    assert luminance[-1] < 0.06
    np.testing.assert_array_equal(residual_tints(np.array([9.0])), tints[-1:])
