from __future__ import annotations

import pytest
import torch

from boltpose.networks.dgcnn import Dgcnn, DgcnnConfig, EdgeConv
from boltpose.networks.neighbours import gather, nearest_neighbours


def test_edge_convolution_is_the_textbook_one() -> None:
    layer = EdgeConv(6, 8, 9, slope=0.2).double()
    features = torch.randn(2, 40, 6, dtype=torch.float64, requires_grad=True)
    index = nearest_neighbours(features, features, 5)

    own = features[:, :, None].expand(-1, -1, 5, -1)
    pairs = torch.cat([gather(features, index) - own, own], dim=3)
    wanted = layer.more(layer.act(layer.edges.linear(pairs))).amax(dim=2)
    got = layer(features, index)

    torch.testing.assert_close(got, wanted, atol=1e-10, rtol=1e-10)
    leaves = [features, *layer.parameters()]
    for one, other in zip(
        torch.autograd.grad(got.sin().sum(), leaves),
        torch.autograd.grad(wanted.sin().sum(), leaves),
        strict=True,
    ):
        torch.testing.assert_close(one, other, atol=1e-9, rtol=1e-9)


def test_later_graphs_are_those_of_the_features(monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[int] = []

    def spy(queries: torch.Tensor, points: torch.Tensor, count: int) -> torch.Tensor:
        searched.append(points.shape[2])
        return nearest_neighbours(queries, points, count)

    monkeypatch.setattr("boltpose.networks.dgcnn.nearest_neighbours", spy)
    Dgcnn(DgcnnConfig(inputs=9, classes=2, channels=16))(torch.randn(2, 40, 9))
    assert searched == [3, 16, 16]


@pytest.mark.parametrize(
    ("name", "value"), [("inputs", 2), ("neighbours", 0), ("dropout", -0.1), ("slope", 1.0)]
)
def test_settings_are_checked(name: str, value: float) -> None:
    settings = {"inputs": 3, "classes": 2, name: value}
    with pytest.raises(ValueError, match=name):
        DgcnnConfig(**settings)  # pyright: ignore[reportArgumentType]
