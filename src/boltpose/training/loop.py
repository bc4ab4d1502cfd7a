"""The one training loop: AdamW, warm-up, cosine, clipping, checkpoints."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from boltpose.training.checkpoint import load_checkpoint, save_checkpoint

Batch = tuple[Tensor, Tensor]
"""Inputs, (..., channels) float32, and classes, (...) int64 from 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitConfig:
    """How a network is fitted."""

    steps: int
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    warmup_share: float = 0.05
    """Share of the steps in which the learning rate rises from 0."""
    final_rate: float = 0.01
    """Learning rate of the last step, relative to `learning_rate`."""
    clip_norm: float = 5.0
    label_smoothing: float = 0.05
    class_weights: tuple[float, ...] = ()
    """One per class; all 1 if empty."""
    use_bfloat16: bool = False
    """Multiply in bfloat16: 1.6 times faster on processors that have it, slower on others."""
    checkpoint_every: int = 100
    """Steps between checkpoints."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"steps must be >= 1, got {self.steps}")
        for name in ("learning_rate", "clip_norm"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in ("warmup_share", "final_rate", "label_smoothing"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must be in [0, 1), got {getattr(self, name)}")

    def rate(self, step: int) -> float:
        """Learning rate of a step, relative to `learning_rate`."""
        warmup = max(1, round(self.warmup_share * self.steps))
        if step < warmup:
            return (step + 1) / warmup
        progress = (step - warmup) / max(1, self.steps - warmup)
        return self.final_rate + (1 - self.final_rate) * (1 + math.cos(math.pi * progress)) / 2


def fit(
    network: nn.Module,
    sample_batch: Callable[[np.random.Generator], Batch],
    config: FitConfig,
    *,
    checkpoint: Path | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> float:
    """Fit a network to batches, in place, and leave it in evaluation mode.

    Args:
        network: Maps inputs, (..., channels), to class scores, (..., classes).
        sample_batch: Draws a batch; every step gets its own generator, so that a resumed run
            sees the batches an uninterrupted one would have seen.
        config: The recipe.
        checkpoint: File to resume from and to write to; deleted at the end.
        on_step: Called after every step with its number, from 0, and the loss.

    Returns:
        Mean loss of the last tenth of the steps that ran.
    """
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    start = 0
    if checkpoint is not None and checkpoint.exists():
        start = load_checkpoint(checkpoint, network, optimizer)
    weights = torch.tensor(config.class_weights) if config.class_weights else None
    losses: list[float] = []
    network.train()
    for step in range(start, config.steps):
        for group in optimizer.param_groups:
            group["lr"] = config.learning_rate * config.rate(step)
        torch.manual_seed(config.seed * 1_000_003 + step)
        inputs, classes = sample_batch(np.random.default_rng([config.seed, step]))
        optimizer.zero_grad(set_to_none=True)
        with torch.autocast("cpu", torch.bfloat16, enabled=config.use_bfloat16):
            scores: Tensor = network(inputs)
        loss = functional.cross_entropy(
            scores.float().flatten(0, -2),
            classes.flatten(),
            weight=weights,
            label_smoothing=config.label_smoothing,
        )
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), config.clip_norm)
        optimizer.step()
        losses.append(float(loss.detach()))
        on_step(step, losses[-1])
        if checkpoint is not None and (step + 1) % config.checkpoint_every == 0:
            save_checkpoint(checkpoint, network, optimizer, step + 1)
    network.eval()
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return float(np.mean(losses[-max(1, len(losses) // 10) :])) if losses else math.nan
