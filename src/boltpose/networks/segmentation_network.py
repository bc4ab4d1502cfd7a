"""What every segmentation network shares: inputs, standardisation, the usual layer."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from boltpose.networks.batch_norm import SharedBatchNorm1d

CLIP = 6.0
"""Standardised inputs are clipped to this: one wild point does not reach the others."""


class SegmentationNetwork(nn.Module):
    """Maps inputs of shape (B, N, inputs) to class scores of shape (B, N, classes).

    The first three inputs are coordinates; normals or dense features may follow. Inputs are
    standardised with the constants `mean` and `scale`, which are part of the network's state.
    """

    mean: Tensor
    scale: Tensor

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))

    def set_standardisation(self, mean: Tensor, scale: Tensor) -> None:
        """Store mean and standard deviation of the inputs, each of shape (inputs,)."""
        self.mean.copy_(mean)
        self.scale.copy_(scale)

    def standardised(self, inputs: Tensor) -> Tensor:
        """Inputs (B, N, inputs) with mean 0 and deviation 1 over the training data, clipped."""
        return torch.clamp((inputs - self.mean) / self.scale, -CLIP, CLIP)


def linear_norm_relu(inputs: int, outputs: int) -> nn.Sequential:
    """Point-wise linear layer, batch normalisation, ReLU; input of shape (B, inputs, N)."""
    return nn.Sequential(
        nn.Conv1d(inputs, outputs, 1, bias=False), SharedBatchNorm1d(outputs), nn.ReLU(inplace=True)
    )
