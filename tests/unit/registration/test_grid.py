import numpy as np
import pytest
from scipy.spatial import KDTree

from boltpose.registration.grid import build_nearest_grid, thin_with_normals


def cloud(seed: int = 0, count: int = 3000) -> np.ndarray:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return 30.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_answer_is_at_most_two_cell_diagonals_farther_than_the_nearest_point() -> None:
    points = cloud()
    grid = build_nearest_grid(points, cell_mm=2.5, margin_mm=10.0)
    queries = np.random.default_rng(1).uniform(-38.0, 38.0, size=(500, 3))

    found = np.linalg.norm(points[grid.nearest(queries)] - queries, axis=1)

    exact, _ = KDTree(points).query(queries)
    assert (found >= exact - 1e-9).all()
    assert (found <= exact + 2 * 2.5 * np.sqrt(3)).all()


def test_a_cell_answers_with_the_point_closest_to_its_centre() -> None:
    points = np.array([[0.1, 0.1, 0.1], [1.0, 1.0, 1.0], [1.9, 1.9, 1.9], [9.0, 9.0, 9.0]])
    grid = build_nearest_grid(points, cell_mm=2.0, margin_mm=0.0)

    assert grid.nearest(np.array([[0.1, 0.1, 0.1], [1.2, 1.2, 1.2]])).tolist() == [1, 1]


def test_queries_outside_the_box_get_the_answer_of_its_border() -> None:
    points = cloud()
    grid = build_nearest_grid(points, cell_mm=2.5, margin_mm=5.0)

    far = grid.nearest(np.array([[500.0, 0.0, 0.0], [-500.0, 0.0, 0.0]]))

    assert points[far[0], 0] > 20.0
    assert points[far[1], 0] < -20.0


def test_batched_queries_keep_their_shape_and_precision_makes_no_difference() -> None:
    grid = build_nearest_grid(cloud(), cell_mm=2.5, margin_mm=5.0)
    # multiples of 0.25 are exact in both precisions
    queries = np.random.default_rng(2).integers(-120, 120, size=(4, 50, 3)) * 0.25

    answer = grid.nearest(queries)

    assert answer.shape == (4, 50)
    same = grid.nearest(queries.astype(np.float32)) == answer
    assert same.mean() > 0.99


def test_a_cell_size_that_is_not_positive_is_refused() -> None:
    with pytest.raises(ValueError, match="cell_mm must be > 0, got nan"):
        build_nearest_grid(cloud(), cell_mm=float("nan"), margin_mm=5.0)


def test_thinning_keeps_unit_normals_and_drops_sheets_seen_from_both_sides() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [5.0, 0.0, 0.0], [5.1, 0.0, 0.0]])
    normals = np.array([[0, 0, 1.0], [0, 0.6, 0.8], [0, 0, 1.0], [0, 0, -1.0]])

    thin, directions = thin_with_normals(points, normals, 1.0)

    np.testing.assert_allclose(thin, [[0.05, 0.0, 0.0]])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
