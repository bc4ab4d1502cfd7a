from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from boltpose.errors import ShapeError
from boltpose.geometry.normals import (
    estimate_normals,
    fibonacci_directions,
    orient_outward,
    orient_towards,
)
from boltpose.geometry.transforms import Transform
from tests.support.strategies import transforms


def dented_sphere() -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals of a sphere of 40 mm; 0.9 mm spacing."""
    directions = fibonacci_directions(20000)
    return 40.0 * directions, directions


def test_fibonacci_directions_are_even() -> None:
    directions = fibonacci_directions(500)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert np.linalg.norm(directions.mean(axis=0)) < 0.01


@settings(max_examples=5, deadline=None)
@given(transforms())
def test_normals_of_a_sphere_point_out_of_it_wherever_it_is(moved_from_own: Transform) -> None:
    points, outward = dented_sphere()
    points, outward = moved_from_own.apply(points), moved_from_own.rotate(outward)

    normals = orient_outward(points, estimate_normals(points, 12))

    assert np.einsum("ni,ni->n", normals, outward).min() > 0.99


def test_both_walls_of_a_pipe_face_away_from_the_material() -> None:
    angle, height = np.meshgrid(np.arange(0, 2 * np.pi, 0.04), np.arange(0, 15, 0.8))
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1).reshape(-1, 3)
    up = np.stack([0 * height, 0 * height, height], axis=-1).reshape(-1, 3)
    points = np.concatenate([25 * ring + up, 21 * ring + up])
    outward = np.concatenate([ring, -ring])

    normals = orient_outward(points, estimate_normals(points, 10))

    assert np.mean(np.einsum("ni,ni->n", normals, outward) > 0.9) > 0.97


def test_normals_at_an_index_equal_those_of_all() -> None:
    points, _ = dented_sphere()
    index = np.array([5, 700, 19000])
    np.testing.assert_array_equal(
        estimate_normals(points, 12, at=index), estimate_normals(points, 12)[index]
    )


def test_a_view_faces_its_camera() -> None:
    points = np.array([[0.0, 0, 500], [100, 0, 600]])
    normals = np.array([[0.0, 0, 1], [0, 0, -1]])
    np.testing.assert_array_equal(
        orient_towards(points, normals, np.zeros(3)), [[0, 0, -1], [0, 0, -1]]
    )


def test_two_points_make_no_plane() -> None:
    with pytest.raises(ShapeError, match="at least 3 rows, got 2"):
        estimate_normals(np.zeros((2, 3)))
