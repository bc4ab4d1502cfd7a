"""A small network that looks at one point's features at a time."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn


@dataclass(frozen=True, slots=True, kw_only=True)
class PointMlpConfig:
    """Size of the network."""

    inputs: int
    classes: int
    hidden: int = 128
    dropout: float = 0.1

    def __post_init__(self) -> None:
        for name in ("inputs", "classes", "hidden"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        if not 0 <= self.dropout < 1:
            raise ValueError(f"dropout must be in [0, 1), got {self.dropout}")


class PointMlp(nn.Module):
    """Class scores of points by their own features alone: the local evidence.

    Inputs are standardised with constants that are part of the network.
    """

    mean: Tensor
    scale: Tensor

    def __init__(self, config: PointMlpConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("mean", torch.zeros(config.inputs))
        self.register_buffer("scale", torch.ones(config.inputs))
        self.layers = nn.Sequential(
            nn.Linear(config.inputs, config.hidden),
            nn.LayerNorm(config.hidden),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(config.hidden, config.hidden),
            nn.LayerNorm(config.hidden),
            nn.ReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(config.hidden, config.classes),
        )

    def set_standardisation(self, mean: Tensor, scale: Tensor) -> None:
        """Store mean and standard deviation of the inputs, each of shape (inputs,)."""
        self.mean.copy_(mean)
        self.scale.copy_(scale)

    def forward(self, inputs: Tensor) -> Tensor:
        """Class scores (logits) of rows, (N, inputs) to (N, classes)."""
        standard = torch.clamp((inputs - self.mean) / self.scale, -6.0, 6.0)
        scores: Tensor = self.layers(standard)
        return scores
