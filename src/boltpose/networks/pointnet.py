"""PointNet: every point by itself, joined by one maximum over the cloud."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from boltpose.networks.layers import LinearNormRelu, NormRelu, PointsAndCloudLinear
from boltpose.networks.segmentation_network import SegmentationNetwork


@dataclass(frozen=True, slots=True, kw_only=True)
class PointNetConfig:
    """Size of the network; the defaults are the published ones."""

    inputs: int
    """Numbers per point: coordinates first, then features."""
    classes: int
    local: int = 64
    """Channels of the first two layers, which the feature transform turns."""
    hidden: int = 128
    embedding: int = 1024
    """Channels of the maximum over the cloud."""
    head: tuple[int, ...] = (512, 256, 128)
    transform_head: tuple[int, int] = (512, 256)
    """Layers of both transform networks after their maximum."""
    penalty_weight: float = 0.001
    """Of the feature transform's distance from an orthogonal one, in the loss."""

    def __post_init__(self) -> None:
        for name in ("classes", "local", "hidden", "embedding"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        if self.inputs < 3:
            raise ValueError(f"inputs must be >= 3, got {self.inputs}")
        if not self.head or min(self.head + self.transform_head) < 1:
            raise ValueError(f"head must be >= 1, got {self.head}, {self.transform_head}")
        if not self.penalty_weight >= 0:
            raise ValueError(f"penalty_weight must be >= 0, got {self.penalty_weight}")


class TransformNetwork(nn.Module):
    """A small PointNet that finds a matrix for the whole cloud; it starts as the identity.

    Source:
        Qi et al., CVPR 2017, section 4.2, sizes in its appendix C.
    """

    def __init__(self, inputs: int, size: int, config: PointNetConfig) -> None:
        super().__init__()
        self.size = size
        wide, narrow = config.transform_head
        self.points = nn.Sequential(
            LinearNormRelu(inputs, config.local),
            LinearNormRelu(config.local, config.hidden),
            LinearNormRelu(config.hidden, config.embedding),
        )
        self.cloud = nn.Sequential(
            LinearNormRelu(config.embedding, wide), LinearNormRelu(wide, narrow)
        )
        self.matrix = nn.Linear(narrow, size * size)
        nn.init.zeros_(self.matrix.weight)
        with torch.no_grad():
            self.matrix.bias.copy_(torch.eye(size).flatten())

    def forward(self, features: Tensor) -> Tensor:
        """Shape (B, N, inputs) to (B, size, size)."""
        entries: Tensor = self.matrix(self.cloud(self.points(features).amax(dim=1)))
        return entries.reshape(-1, self.size, self.size)


class PointNet(SegmentationNetwork):
    """Class scores of every point of a cloud.

    Not as published:
        - The input transform turns the coordinates only; normals and further inputs pass.
        - Linear layers in front of a batch normalisation have no bias; it would cancel.
        - The regulariser is a mean over the clouds of the batch, so that it does not grow with it.
        - Inputs are standardised with constants that are part of the network.

    Training needs two clouds per step: the transforms normalise over clouds.

    Source:
        Qi et al., CVPR 2017, section 4.2 and figure 2 (segmentation network).
    """

    def __init__(self, config: PointNetConfig) -> None:
        super().__init__(config.inputs)
        self.config = config
        local, hidden = config.local, config.hidden
        self.input_transform = TransformNetwork(3, 3, config)
        self.first = nn.Sequential(
            LinearNormRelu(config.inputs, local), LinearNormRelu(local, local)
        )
        self.feature_transform = TransformNetwork(local, local, config)
        self.second = nn.Sequential(
            LinearNormRelu(local, local),
            LinearNormRelu(local, hidden),
            LinearNormRelu(hidden, config.embedding),
        )
        sizes = config.head
        self.join = PointsAndCloudLinear(local, config.embedding, sizes[0])
        self.join_act = NormRelu(sizes[0])
        self.head = nn.Sequential(
            *(LinearNormRelu(*pair) for pair in pairwise(sizes)),
            nn.Linear(sizes[-1], config.classes),
        )
        self._last_transform: Tensor | None = None

    def penalty(self) -> Tensor:
        """What the last training step adds to the loss: how far its transforms are from turns.

        Returns:
            `penalty_weight` times the mean over clouds of |I - A A^T|^2; zero before a step. Read
            once per step: the graph behind it is handed over, not kept.

        Source:
            Qi et al., CVPR 2017, equation 2; weight 0.001 from appendix C.
        """
        transform, self._last_transform = self._last_transform, None
        if transform is None:
            return self.mean.new_zeros(())
        with torch.autocast(transform.device.type, enabled=False):
            matrix = transform.float()
            excess = torch.eye(self.config.local, device=matrix.device) - matrix @ matrix.transpose(
                1, 2
            )
            return self.config.penalty_weight * excess.square().sum(dim=(1, 2)).mean()

    def forward(self, inputs: Tensor) -> Tensor:
        """Class scores (logits).

        Args:
            inputs: Shape (B, N, inputs), float32, as they come, not standardised.

        Returns:
            Shape (B, N, classes).
        """
        standard = self.standardised(inputs)
        xyz = standard[:, :, :3]
        turned = xyz @ self.input_transform(xyz)
        features = self.first(torch.cat([turned, standard[:, :, 3:]], dim=2))
        transform = self.feature_transform(features)
        if self.training:
            self._last_transform = transform
        features = features @ transform
        cloud = self.second(features).amax(dim=1)
        scores: Tensor = self.head(self.join_act(self.join(features, cloud)))
        return scores
