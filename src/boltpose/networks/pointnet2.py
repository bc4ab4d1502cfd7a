"""PointNet++: PointNet on balls around fewer and fewer centres, and back to all points."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from boltpose.networks.layers import LinearNormRelu, NormRelu
from boltpose.networks.neighbours import (
    ball_neighbours,
    farthest_point_sample,
    gather,
    interpolate,
)
from boltpose.networks.segmentation_network import SegmentationNetwork


@dataclass(frozen=True, slots=True, kw_only=True)
class PointNet2Config:
    """Size of the network; the defaults are the published ones for part segmentation, SSG."""

    inputs: int
    """Numbers per point: coordinates first, then features."""
    classes: int
    centres: tuple[int, int] = (512, 128)
    radii: tuple[float, float] = (0.2, 0.4)
    """Of the balls around the centres; the cloud's own radius is 1."""
    neighbours: tuple[int, int] = (32, 64)
    down_1: tuple[int, ...] = (64, 64, 128)
    down_2: tuple[int, ...] = (128, 128, 256)
    down_3: tuple[int, ...] = (256, 512, 1024)
    up_3: tuple[int, ...] = (256, 256)
    up_2: tuple[int, ...] = (256, 128)
    up_1: tuple[int, ...] = (128, 128, 128)
    head: int = 128
    dropout: float = 0.5

    def __post_init__(self) -> None:
        if self.inputs < 3:
            raise ValueError(f"inputs must be >= 3, got {self.inputs}")
        for name in ("classes", "head"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        for name in ("centres", "neighbours", "down_1", "down_2", "down_3", "up_3", "up_2", "up_1"):
            sizes: tuple[int, ...] = getattr(self, name)
            if not sizes or min(sizes) < 1:
                raise ValueError(f"{name} must be >= 1, got {sizes}")
        if self.centres[1] > self.centres[0]:
            raise ValueError(f"centres must fall from level to level, got {self.centres}")
        if not min(self.radii) > 0:
            raise ValueError(f"radii must be > 0, got {self.radii}")
        if not 0 <= self.dropout < 1:
            raise ValueError(f"dropout must be in [0, 1), got {self.dropout}")


class SetAbstraction(nn.Module):
    """A PointNet on each ball: offsets from the centre and features, layers, maximum.

    The first linear layer is applied before the gathering, once per point instead of once per
    member of a ball: W (x - c) + V f = (W x + V f) - W c.

    Source:
        Qi et al., NeurIPS 2017, section 3.2.
    """

    def __init__(self, inputs: int, sizes: tuple[int, ...]) -> None:
        super().__init__()
        self.linear = nn.Linear(3 + inputs, sizes[0], bias=False)
        self.act = NormRelu(sizes[0])
        self.more = layers(sizes)

    def forward(self, centres: Tensor, xyz: Tensor, features: Tensor, index: Tensor) -> Tensor:
        """Features of balls.

        Args:
            centres: Shape (B, M, 3).
            xyz: Shape (B, N, 3).
            features: Shape (B, N, inputs).
            index: Shape (B, M, K), into the N points.

        Returns:
            Shape (B, M, last size).
        """
        points = self.linear(torch.cat([xyz, features], dim=2))
        shift = functional.linear(centres, self.linear.weight[:, :3])
        members = gather(points, index) - shift[:, :, None]
        result: Tensor = self.more(self.act(members))
        return result.amax(dim=2)


class PointNet2(SegmentationNetwork):
    """Class scores of every point of a cloud.

    Grouping and the coordinates the layers see are those of the cloud shifted to its mean and
    scaled so that its farthest point lies at 1, inside the network; further inputs are
    standardised with constants that are part of the network.

    Not as published:
        - A ball takes its nearest members, not the first of the list; see `ball_neighbours`.
        - No class-of-the-object input.
        - Fewer than 512 points are all centres, and fewer than a ball's count are all members.

    Source:
        Qi et al., NeurIPS 2017, section 3 and appendix B.1 (SSG, part segmentation).
    """

    def __init__(self, config: PointNet2Config) -> None:
        super().__init__(config.inputs)
        self.config = config
        extra = config.inputs - 3
        one, two, three = config.down_1[-1], config.down_2[-1], config.down_3[-1]
        self.down_1 = SetAbstraction(extra, config.down_1)
        self.down_2 = SetAbstraction(one, config.down_2)
        self.down_3 = layers((3 + two, *config.down_3))
        self.up_3 = layers((three + two, *config.up_3))
        self.up_2 = layers((config.up_3[-1] + one, *config.up_2))
        self.up_1 = layers((config.up_2[-1] + 3 + extra, *config.up_1))
        self.head = nn.Sequential(
            LinearNormRelu(config.up_1[-1], config.head),
            nn.Dropout(config.dropout),
            nn.Linear(config.head, config.classes),
        )

    def forward(
        self, inputs: Tensor, centres_1: Tensor | None = None, centres_2: Tensor | None = None
    ) -> Tensor:
        """Class scores (logits).

        Args:
            inputs: Shape (B, N, inputs), float32, as they come, not standardised.
            centres_1: Shape (B, <= 512), int64, into the points; found by farthest point
                sampling of the coordinates, from index 0, if left out.
            centres_2: Shape (B, <= 128), int64, into `centres_1`; its first ones if left out,
                which are what farthest point sampling would choose again.

        Returns:
            Shape (B, N, classes).
        """
        most_1, most_2 = self.config.centres
        if centres_1 is None:
            centres_1 = farthest_point_sample(inputs[:, :, :3], most_1)
        if centres_2 is None:
            prefix = torch.arange(min(most_2, centres_1.shape[1]), device=inputs.device)
            centres_2 = prefix.expand(len(inputs), -1)
        xyz = to_unit_sphere(inputs[:, :, :3])
        extra = self.standardised(inputs)[:, :, 3:]

        xyz_1 = gather(xyz, centres_1)
        balls_1 = ball_neighbours(xyz_1, xyz, self.config.radii[0], self.config.neighbours[0])
        features_1 = self.down_1(xyz_1, xyz, extra, balls_1)
        xyz_2 = gather(xyz_1, centres_2)
        balls_2 = ball_neighbours(xyz_2, xyz_1, self.config.radii[1], self.config.neighbours[1])
        features_2 = self.down_2(xyz_2, xyz_1, features_1, balls_2)
        cloud = self.down_3(torch.cat([xyz_2, features_2], dim=2)).amax(dim=1, keepdim=True)

        spread = cloud.expand(-1, features_2.shape[1], -1)
        features_2 = self.up_3(torch.cat([spread, features_2], dim=2))
        back_1 = interpolate(xyz_1, xyz_2, features_2)
        features_1 = self.up_2(torch.cat([back_1, features_1], dim=2))
        back = interpolate(xyz, xyz_1, features_1)
        features = self.up_1(torch.cat([back, xyz, extra], dim=2))
        scores: Tensor = self.head(features)
        return scores


def layers(sizes: tuple[int, ...]) -> nn.Sequential:
    """Linear layers with batch normalisation and ReLU between consecutive sizes."""
    return nn.Sequential(*(LinearNormRelu(*pair) for pair in pairwise(sizes)))


def to_unit_sphere(xyz: Tensor) -> Tensor:
    """Shift each cloud (B, N, 3) to its mean and scale its farthest point to distance 1."""
    centred = xyz - xyz.mean(dim=1, keepdim=True)
    radius = centred.square().sum(dim=2, keepdim=True).amax(dim=1, keepdim=True).sqrt()
    return centred / radius.clamp(min=1e-6)
