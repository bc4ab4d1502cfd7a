from __future__ import annotations

import numpy as np
import pytest
import torch

from boltpose.networks.neighbours import farthest_point_sample
from boltpose.segmentation.farthest_points import farthest_points, nested_centres


@pytest.mark.parametrize("seed", range(12))
def test_the_choice_is_that_of_the_network_to_the_last_index(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(3, int(rng.integers(5, 900)), 3)).astype(np.float32)
    if seed % 3 == 0:  # many equal distances and equal points
        places = np.round(places, 1)
    wanted = farthest_point_sample(torch.from_numpy(places), 256).numpy()
    np.testing.assert_array_equal(farthest_points(places, 256), wanted)


def test_every_centre_is_the_farthest_from_those_before() -> None:
    places = np.random.default_rng(0).normal(size=(1, 300, 3)).astype(np.float32)
    chosen = farthest_points(places, 40)[0]
    assert chosen[0] == 0
    apart = np.linalg.norm(places[0][:, None] - places[0][chosen], axis=2)
    for turn in range(1, 40):
        reach = apart[:, :turn].min(axis=1)
        assert reach[chosen[turn]] == pytest.approx(reach.max(), abs=1e-6)


def test_centres_of_centres_are_chosen_as_from_all_points() -> None:
    places = np.random.default_rng(1).normal(size=(2, 400, 3)).astype(np.float32)
    first, second = nested_centres(places, (200, 50))
    of_first = np.take_along_axis(places, first[:, :, None], axis=1)
    np.testing.assert_array_equal(second, farthest_points(of_first, 50))


def test_a_cloud_with_fewer_points_than_centres_gives_them_all() -> None:
    places = np.random.default_rng(2).normal(size=(2, 90, 3)).astype(np.float32)
    first, second = nested_centres(places, (512, 128))
    assert first.shape == second.shape == (2, 90)
    np.testing.assert_array_equal(np.sort(first, axis=1), np.tile(np.arange(90), (2, 1)))
