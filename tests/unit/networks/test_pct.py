from __future__ import annotations

import pytest
import torch
from torch import nn

from boltpose.networks.neighbours import gather, nearest_neighbours
from boltpose.networks.pct import NeighbourEmbedding, OffsetAttention, Pct, PctConfig


def _small(inputs: int = 7) -> Pct:
    return Pct(PctConfig.small(inputs, 3, channels=16, layers=2, embedding=32))


def test_a_layer_with_nothing_to_add_is_the_identity() -> None:
    layer = OffsetAttention(8).eval()
    torch.nn.init.zeros_(layer.after[0].weight)
    features = torch.randn(2, 8, 30)
    torch.testing.assert_close(layer(features), features)


def test_permuted_points_get_permuted_scores() -> None:
    network = _small().eval()
    inputs = torch.randn(1, 90, 7)
    order = torch.randperm(90)
    with torch.inference_mode():
        torch.testing.assert_close(
            network(inputs[:, order]), network(inputs)[:, order], atol=1e-5, rtol=1e-5
        )


def test_the_head_multiplies_the_features_of_the_whole_cloud_once() -> None:
    network = _small().double()
    fused = torch.randn(2, 32, 40, dtype=torch.float64)
    largest = fused.amax(dim=2, keepdim=True).expand_as(fused)
    average = fused.mean(dim=2, keepdim=True).expand_as(fused)
    wanted = network.head[0](torch.cat([fused, largest, average], dim=1))
    torch.testing.assert_close(network._join_head(fused), wanted)


def test_neighbour_embedding_is_the_textbook_one() -> None:
    layer = NeighbourEmbedding(6, 10).double()
    features = torch.randn(2, 40, 6, dtype=torch.float64)
    index = nearest_neighbours(features, features, 5)
    own = features[:, :, None].expand(-1, -1, 5, -1)
    pairs = torch.cat([gather(features, index) - own, own], dim=3)
    wanted = layer.second(layer.act(layer.edges.linear(pairs))).amax(dim=2)
    torch.testing.assert_close(layer(features, index), wanted)


def test_the_small_network_has_the_names_its_files_were_written_with() -> None:
    network = Pct(PctConfig.small(92, 6))
    names = {name.rsplit(".", 1)[0] for name in network.state_dict()}
    assert names == {
        *("mean", "scale", "embed.0.0", "embed.0.1", "embed.1.0", "embed.1.1", "fuse.0", "fuse.1"),
        *(f"attention.{n}.{part}" for n in (0, 1) for part in ("query", "value")),
        *(f"attention.{n}.after.{part}" for n in (0, 1) for part in (0, 1)),
        *("head.0.0", "head.0.1", "head.2.0", "head.2.1", "head.3"),
    }
    assert network.fuse[0].weight.shape == (256, 3 * 64, 1)
    assert network.head[0][0].weight.shape == (128, 3 * 256, 1)
    assert network.head[2][0].weight.shape == (64, 128, 1)
    assert sum(value.numel() for value in network.parameters()) == 185_990
    drops = [module.p for module in network.modules() if isinstance(module, nn.Dropout)]
    assert drops == [0.3]


def test_standardisation_is_part_of_the_network() -> None:
    network = _small().eval()
    inputs = torch.randn(1, 40, 7)
    with torch.inference_mode():
        wanted = network(inputs)
        network.set_standardisation(torch.full((7,), 5.0), torch.full((7,), 3.0))
        torch.testing.assert_close(network(inputs * 3 + 5), wanted, atol=1e-4, rtol=1e-4)


def test_an_outlier_is_clipped() -> None:
    network = _small().eval()
    inputs = torch.randn(1, 40, 7)
    far, farther = inputs.clone(), inputs.clone()
    far[0, 0, 0], farther[0, 0, 0] = 100.0, 1e9
    with torch.inference_mode():
        torch.testing.assert_close(network(far), network(farther))


@pytest.mark.parametrize(
    ("name", "value"),
    [("inputs", 0), ("classes", 0), ("channels", 6), ("dropout", 1.0), ("attention", "x")],
)
def test_settings_are_checked(name: str, value: object) -> None:
    settings = {"inputs": 3, "classes": 2, name: value}
    with pytest.raises(ValueError, match=name):
        PctConfig(**settings)  # pyright: ignore[reportArgumentType]
