"""DGCNN: convolutions over the edges of a neighbour graph, found anew in every layer."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from boltpose.networks.layers import EdgeLinear, LinearNormRelu, NormRelu, PointsAndCloudLinear
from boltpose.networks.neighbours import nearest_neighbours
from boltpose.networks.segmentation_network import SegmentationNetwork


@dataclass(frozen=True, slots=True, kw_only=True)
class DgcnnConfig:
    """Size of the network; the defaults are the published ones for semantic segmentation."""

    inputs: int
    """Numbers per point: coordinates first, then features."""
    classes: int
    channels: int = 64
    """Of every edge convolution."""
    embedding: int = 1024
    """Channels of the maximum over the cloud."""
    head: tuple[int, int] = (512, 256)
    dropout: float = 0.5
    """After the last layer of the head."""
    neighbours: int = 20
    slope: float = 0.2
    """Of the leaky ReLUs."""

    def __post_init__(self) -> None:
        for name in ("classes", "channels", "embedding", "neighbours"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        if self.inputs < 3:
            raise ValueError(f"inputs must be >= 3, got {self.inputs}")
        if min(self.head) < 1:
            raise ValueError(f"head must be >= 1, got {self.head}")
        if not 0 <= self.dropout < 1:
            raise ValueError(f"dropout must be in [0, 1), got {self.dropout}")
        if not 0 <= self.slope < 1:
            raise ValueError(f"slope must be in [0, 1), got {self.slope}")


class EdgeConv(nn.Module):
    """Layers on the edges from a point to its neighbours, then the maximum over the edges.

    Source:
        Wang et al., ACM Transactions on Graphics 38(5), 2019, equations 7 and 8.
    """

    def __init__(self, inputs: int, *outputs: int, slope: float) -> None:
        super().__init__()
        self.edges = EdgeLinear(inputs, outputs[0])
        self.act = NormRelu(outputs[0], slope)
        self.more = nn.Sequential(*(LinearNormRelu(*pair, slope) for pair in pairwise(outputs)))

    def forward(self, features: Tensor, index: Tensor) -> Tensor:
        """Shape (B, N, inputs) and neighbours (B, N, K) to (B, N, outputs)."""
        edges: Tensor = self.more(self.act(self.edges(features, index)))
        return edges.amax(dim=2)


class Dgcnn(SegmentationNetwork):
    """Class scores of every point of a cloud.

    The semantic-segmentation variant (three edge convolutions); the part-segmentation one adds a
    transform network and a class-of-the-object input.

    Not as published:
        - The first graph is that of the coordinates, where there are further inputs.
        - Inputs are standardised with constants that are part of the network.

    Source:
        Wang et al., ACM Transactions on Graphics 38(5), 2019, section 5.4 and figure 3 (the
        lower branch without its transform), sizes as in the authors' code.
    """

    def __init__(self, config: DgcnnConfig) -> None:
        super().__init__(config.inputs)
        self.config = config
        size, slope = config.channels, config.slope
        self.convolutions = nn.ModuleList(
            [
                EdgeConv(config.inputs, size, size, slope=slope),
                EdgeConv(size, size, size, slope=slope),
                EdgeConv(size, size, slope=slope),
            ]
        )
        self.embed = LinearNormRelu(3 * size, config.embedding, slope)
        wide, narrow = config.head
        self.join = PointsAndCloudLinear(3 * size, config.embedding, wide)
        self.join_act = NormRelu(wide, slope)
        self.head = nn.Sequential(
            LinearNormRelu(wide, narrow, slope),
            nn.Dropout(config.dropout),
            nn.Linear(narrow, config.classes, bias=False),
        )

    def forward(self, inputs: Tensor) -> Tensor:
        """Class scores (logits).

        Args:
            inputs: Shape (B, N, inputs), float32, as they come, not standardised.

        Returns:
            Shape (B, N, classes).
        """
        features = self.standardised(inputs)
        place = inputs[:, :, :3]
        levels: list[Tensor] = []
        for convolution in self.convolutions:
            index = nearest_neighbours(place, place, self.config.neighbours)
            features = convolution(features, index)
            place = features
            levels.append(features)
        points = torch.cat(levels, dim=2)
        cloud = self.embed(points).amax(dim=1)
        scores: Tensor = self.head(self.join_act(self.join(points, cloud)))
        return scores
