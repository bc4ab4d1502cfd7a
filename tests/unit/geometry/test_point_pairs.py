import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.geometry.point_pairs import PAIR_WORDS, pair_histogram


def surface(count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(count, 3))
    return rng.uniform(-80, 80, (count, 3)), normals / np.linalg.norm(normals, axis=1)[:, None]


def test_no_motion_and_no_order_changes_the_histogram() -> None:
    points, normals = surface()
    rotation = Rotation.from_rotvec((0.3, -1.2, 2.0)).as_matrix()
    order = np.random.default_rng(2).permutation(len(points))

    here = pair_histogram(points, normals)
    there = pair_histogram(
        (points @ rotation.T + (5.0, -90.0, 700.0))[order], (normals @ rotation.T)[order]
    )

    assert here.shape == (PAIR_WORDS,)
    assert here.sum() == 1.0
    # a pair on the edge of a cell may fall to the other side by rounding
    assert np.abs(here - there).sum() < 4 / (60 * 59 / 2)


def test_weights_choose_the_pairs_that_count() -> None:
    points, normals = surface()
    first = np.arange(60) < 25
    weights = np.outer(first, first).astype(float)

    np.testing.assert_allclose(
        pair_histogram(points, normals, weights), pair_histogram(points[first], normals[first])
    )
    assert pair_histogram(points, normals, np.zeros((60, 60))).sum() == 0
