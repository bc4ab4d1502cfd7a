"""PCT: a point cloud transformer with offset attention."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self, cast

import torch
from torch import Tensor, nn
from torch.nn.functional import conv1d

from boltpose.networks.attention import offset_attention, sdpa_offset_attention
from boltpose.networks.batch_norm import SharedBatchNorm1d
from boltpose.networks.layers import EdgeLinear, LinearNormRelu, NormRelu
from boltpose.networks.neighbours import nearest_neighbours
from boltpose.networks.segmentation_network import SegmentationNetwork, linear_norm_relu


@dataclass(frozen=True, slots=True, kw_only=True)
class PctConfig:
    """Size of the network; the defaults are the published ones."""

    inputs: int
    """Numbers per point: coordinates first, then features."""
    classes: int
    channels: int = 128
    layers: int = 4
    """Offset-attention layers."""
    embedding: int = 1024
    """Channels the outputs of all layers are fused to."""
    head: tuple[int, int] = (512, 256)
    dropout: float = 0.5
    """After the first layer of the head."""
    neighbours: int = 32
    """Points of a neighbourhood in the input embedding; 0: every point by itself."""
    fuse_input: bool = False
    """Whether the input embedding is fused too, beside the outputs of the layers."""
    attention: Literal["matrix", "sdpa"] = "matrix"
    """`offset_attention` or `sdpa_offset_attention`: the same numbers up to rounding."""

    def __post_init__(self) -> None:
        for name in ("inputs", "classes", "layers", "embedding"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        if self.channels < 4 or self.channels % 4:
            raise ValueError(f"channels must be a multiple of 4, got {self.channels}")
        if min(self.head) < 1:
            raise ValueError(f"head must be >= 1, got {self.head}")
        if not 0 <= self.dropout < 1:
            raise ValueError(f"dropout must be in [0, 1), got {self.dropout}")
        if self.neighbours < 0:
            raise ValueError(f"neighbours must be >= 0, got {self.neighbours}")
        if self.attention not in ("matrix", "sdpa"):
            raise ValueError(f"attention must be matrix or sdpa, got {self.attention!r}")

    @classmethod
    def small(
        cls, inputs: int, classes: int, *, channels: int = 64, layers: int = 2, embedding: int = 256
    ) -> Self:
        """The network for inputs that already describe each point's surroundings."""
        return cls(
            inputs=inputs,
            classes=classes,
            channels=channels,
            layers=layers,
            embedding=embedding,
            head=(2 * channels, channels),
            dropout=0.3,
            neighbours=0,
            fuse_input=True,
        )


class OffsetAttention(nn.Module):
    """One layer: the difference between the input and its attention, transformed and added.

    Source:
        Guo et al., Computational Visual Media 7(2), 2021, equation 10.
    """

    def __init__(self, channels: int, attention: Literal["matrix", "sdpa"] = "matrix") -> None:
        super().__init__()
        self.attend = offset_attention if attention == "matrix" else sdpa_offset_attention
        self.query = nn.Conv1d(channels, channels // 4, 1, bias=False)
        self.value = nn.Conv1d(channels, channels, 1)
        self.after = linear_norm_relu(channels, channels)

    def forward(self, features: Tensor) -> Tensor:
        """Shape (B, C, N) to the same shape."""
        attended = self.attend(self.query(features), self.value(features))
        result: Tensor = features + self.after(features - attended)
        return result


class NeighbourEmbedding(nn.Module):
    """Features of a neighbourhood, the largest of each: the paper's SG layer without sampling.

    Source:
        Guo et al., Computational Visual Media 7(2), 2021, equations 11 to 13.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.edges = EdgeLinear(inputs, outputs)
        self.act = NormRelu(outputs)
        self.second = LinearNormRelu(outputs, outputs)

    def forward(self, features: Tensor, index: Tensor) -> Tensor:
        """Shape (B, N, inputs) and neighbours (B, N, K) to (B, N, outputs)."""
        pairs: Tensor = self.second(self.act(self.edges(features, index)))
        return pairs.amax(dim=2)


class Pct(SegmentationNetwork):
    """Class scores of every point of a cloud.

    Not as published:
        - No class-of-the-object input beside the global features: there is one kind of object.
        - Two neighbour embeddings on all points, of 128 channels each and with one neighbour
          search on the coordinates: the text keeps all points for segmentation, the authors'
          segmentation code has none, their classification code has 128 and 256 on samples.
        - Linear layers in front of a batch normalisation have no bias; it would cancel.
        - Inputs are standardised with constants that are part of the network.
        - `PctConfig.small`: fewer channels and layers, no neighbour embedding, because its input
          already describes each point's surroundings at full resolution.

    Source:
        Guo et al., Computational Visual Media 7(2), 2021, section 3 (segmentation network).
    """

    def __init__(self, config: PctConfig) -> None:
        super().__init__(config.inputs)
        self.config = config
        channels = config.channels
        self.neighbourhoods = nn.ModuleList()
        if config.neighbours:
            half = channels // 2
            self.embed = nn.Sequential(
                linear_norm_relu(config.inputs, half), linear_norm_relu(half, half)
            )
            self.neighbourhoods.append(NeighbourEmbedding(half, channels))
            self.neighbourhoods.append(NeighbourEmbedding(channels, channels))
        else:
            self.embed = nn.Sequential(
                linear_norm_relu(config.inputs, channels), linear_norm_relu(channels, channels)
            )
        self.attention = nn.ModuleList(
            [OffsetAttention(channels, config.attention) for _ in range(config.layers)]
        )
        levels = config.layers + config.fuse_input
        self.fuse = nn.Sequential(
            nn.Conv1d(channels * levels, config.embedding, 1, bias=False),
            SharedBatchNorm1d(config.embedding),
            nn.LeakyReLU(0.2),
        )
        wide, narrow = config.head
        self.head = nn.Sequential(
            linear_norm_relu(3 * config.embedding, wide),
            nn.Dropout(config.dropout),
            linear_norm_relu(wide, narrow),
            nn.Conv1d(narrow, config.classes, 1),
        )

    def forward(self, inputs: Tensor) -> Tensor:
        """Class scores (logits).

        Args:
            inputs: Shape (B, N, inputs), float32, as they come, not standardised.

        Returns:
            Shape (B, N, classes); softmax of them is a probability.
        """
        features = self.embed(self.standardised(inputs).transpose(1, 2))
        if self.config.neighbours:
            xyz = inputs[:, :, :3]
            index = nearest_neighbours(xyz, xyz, self.config.neighbours)
            rows = features.transpose(1, 2)
            for neighbourhood in self.neighbourhoods:
                rows = neighbourhood(rows, index)
            features = rows.transpose(1, 2)
        levels = [features]
        for layer in self.attention:
            levels.append(layer(levels[-1]))
        used = levels if self.config.fuse_input else levels[1:]
        fused = self.fuse(torch.cat(used, dim=1))
        scores: Tensor = self.head[1:](self._join_head(fused))
        return scores.transpose(1, 2)

    def _join_head(self, fused: Tensor) -> Tensor:
        """First layer of the head, of every point's features beside the cloud's two global ones.

        The product with the global features is the same for all points and is taken once; the
        sum is that of the concatenated features, with a third of the multiplications.
        """
        first = cast(nn.Sequential, self.head[0])
        weight = cast(nn.Conv1d, first[0]).weight
        width = fused.shape[1]
        pooled = torch.cat(
            [fused.amax(dim=2, keepdim=True), fused.mean(dim=2, keepdim=True)], dim=1
        )
        joined = conv1d(fused, weight[:, :width]) + conv1d(pooled, weight[:, width:])
        after: Tensor = first[1:](joined)
        return after
