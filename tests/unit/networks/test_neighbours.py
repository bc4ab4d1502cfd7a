from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from scipy.spatial import KDTree
from torch import Tensor, nn

from boltpose.networks.neighbours import (
    ball_neighbours,
    farthest_point_sample,
    gather,
    interpolate,
    nearest_neighbours,
    square_distances,
)


def _clouds(points: int, offset: float = 0.0) -> Tensor:
    return torch.randn(2, points, 3) + offset


def _tree_distances(queries: Tensor, points: Tensor, count: int) -> list[np.ndarray]:
    return [
        KDTree(cloud.double().numpy()).query(query.double().numpy(), k=count)[0]
        for query, cloud in zip(queries, points, strict=True)
    ]


@pytest.mark.parametrize("offset", [0.0, 300.0])
def test_nearest_neighbours_are_those_of_a_tree(offset: float) -> None:
    queries, points = _clouds(80, offset), _clouds(150, offset)
    index = nearest_neighbours(queries, points, 7)
    chosen = (gather(points, index) - queries[:, :, None]).double().norm(dim=3).numpy()
    np.testing.assert_allclose(chosen, _tree_distances(queries, points, 7), atol=2e-4)
    assert all(len(set(row)) == 7 for row in index.reshape(-1, 7).tolist())


def test_a_point_is_its_own_nearest_neighbour() -> None:
    points = _clouds(200)
    index = nearest_neighbours(points, points, 3)
    assert torch.equal(index[:, :, 0], torch.arange(200).expand(2, -1))


def test_square_distances_far_from_the_origin_keep_their_digits() -> None:
    points = _clouds(50, offset=1000.0)
    wanted = torch.cdist(points.double(), points.double()).square()
    got = square_distances(points, points)
    assert (got >= 0).all()
    torch.testing.assert_close(got.double(), wanted, atol=1e-4, rtol=1e-4)


def test_autocast_changes_no_search() -> None:
    points = _clouds(300)
    wanted = nearest_neighbours(points, points, 9)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(nearest_neighbours(points, points, 9), wanted)


def test_ball_neighbours_are_the_nearest_in_the_ball_filled_with_the_nearest() -> None:
    points = _clouds(120)
    queries, radius, count = points[:, ::3], 0.6, 8
    index = ball_neighbours(queries, points, radius, count).numpy()
    for cloud in range(2):
        tree = KDTree(points[cloud].double().numpy())
        inside = tree.query_ball_point(queries[cloud].double().numpy(), radius)
        nearest = tree.query(queries[cloud].double().numpy(), k=count)[1]
        for row, members, order in zip(index[cloud], inside, nearest, strict=True):
            assert set(row) == set(order[: min(count, len(members))])
            assert (row[len(members) :] == order[0]).all()
    sizes = [len(set(row)) for row in index.reshape(-1, count).tolist()]
    assert min(sizes) < count
    assert max(sizes) == count  # both cases were there


def test_a_query_with_an_empty_ball_gets_its_nearest_point() -> None:
    points = _clouds(30)
    index = ball_neighbours(points[:, :1] + 50, points, 0.1, 4)
    nearest = nearest_neighbours(points[:, :1] + 50, points, 1)
    assert torch.equal(index, nearest.expand(-1, -1, 4))


def test_more_neighbours_than_points_are_all_points() -> None:
    points = _clouds(5)
    assert (
        nearest_neighbours(points, points, 20).sort(dim=2).values.tolist()
        == [[list(range(5))] * 5] * 2
    )
    assert ball_neighbours(points, points, 1.0, 20).shape == (2, 5, 5)


def test_farthest_points_are_each_the_farthest_from_the_ones_before() -> None:
    points = _clouds(90)
    index = farthest_point_sample(points, 25)
    assert (index[:, 0] == 0).all()
    for cloud, chosen in zip(points.double(), index, strict=True):
        distances = torch.cdist(cloud, cloud)
        for step in range(1, 25):
            gaps = distances[:, chosen[:step]].amin(dim=1)
            assert gaps[chosen[step]] >= gaps.max() - 1e-6


def test_the_first_of_a_sample_are_the_sample_of_the_sample() -> None:
    points = _clouds(300)
    sample = farthest_point_sample(points, 64)
    again = farthest_point_sample(gather(points, sample), 16)
    assert torch.equal(again, torch.arange(16).expand(2, -1))


def test_a_sample_of_too_few_points_is_all_of_them() -> None:
    sample = farthest_point_sample(_clouds(12), 512)
    assert torch.equal(sample.sort(dim=1).values, torch.arange(12).expand(2, -1))


@pytest.mark.parametrize("shape", [(2, 9), (2, 9, 4)])
def test_gather_takes_rows_of_the_own_cloud(shape: tuple[int, ...]) -> None:
    values = torch.randn(2, 30, 6)
    index = torch.randint(0, 30, shape)
    wanted = torch.stack([cloud[rows] for cloud, rows in zip(values, index, strict=True)])
    assert torch.equal(gather(values, index), wanted)


def test_interpolation_is_the_weighted_mean_of_three() -> None:
    queries, points, values = _clouds(40), _clouds(25), torch.randn(2, 25, 6)
    got = interpolate(queries, points, values)
    for cloud in range(2):
        distances, index = KDTree(points[cloud].double().numpy()).query(
            queries[cloud].double().numpy(), k=3
        )
        weights = 1 / distances**2
        weights /= weights.sum(axis=1, keepdims=True)
        wanted = np.einsum("nk,nkc->nc", weights, values[cloud].double().numpy()[index])
        np.testing.assert_allclose(got[cloud].numpy(), wanted, atol=1e-5)


def test_interpolation_at_a_point_is_its_value() -> None:
    points, values = _clouds(25), torch.randn(2, 25, 6)
    torch.testing.assert_close(interpolate(points, points, values), values, atol=1e-6, rtol=1e-6)


def test_interpolation_from_one_point_spreads_it() -> None:
    values = torch.randn(2, 1, 6)
    got = interpolate(_clouds(10), _clouds(1), values)
    torch.testing.assert_close(got, values.expand(-1, 10, -1))


class _All(nn.Module):
    def forward(self, queries: Tensor, points: Tensor) -> tuple[Tensor, ...]:
        near = nearest_neighbours(queries, points, 20)
        ball = ball_neighbours(queries, points, 0.8, 16)
        gathered = gather(points, ball).sum(dim=2)
        return near, ball, gathered, interpolate(queries, points, points * 2)


@pytest.mark.filterwarnings("ignore")  # torch's exporter warns about itself
def test_exported_functions_agree_at_other_sizes(tmp_path: Path) -> None:
    free = {0: torch.export.Dim.DYNAMIC, 1: torch.export.Dim.DYNAMIC}
    program = torch.onnx.export(
        _All(),
        (_clouds(30), _clouds(60)),
        dynamo=True,
        opset_version=18,
        dynamic_shapes=(free, free),
        verbose=False,
    )
    assert program is not None
    program.save(tmp_path / "functions.onnx")
    session = onnxruntime.InferenceSession(
        tmp_path / "functions.onnx", providers=["CPUExecutionProvider"]
    )
    names = [entry.name for entry in session.get_inputs()]
    for batch, many, few in ((1, 90, 200), (3, 40, 7), (1, 1, 1)):
        queries, points = torch.randn(batch, many, 3), torch.randn(batch, few, 3)
        feed = dict(zip(names, (queries.numpy(), points.numpy()), strict=True))
        for got, wanted in zip(session.run(None, feed), _All()(queries, points), strict=True):
            np.testing.assert_allclose(np.asarray(got), wanted.numpy(), atol=1e-4)
