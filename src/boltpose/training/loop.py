"""The one training loop: AdamW, warm-up, cosine, clipping, checkpoints, any number of processes."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import torch
from lightning_fabric import Fabric
from torch import Tensor, nn
from torch.nn import functional

from boltpose.arrays import Float32Array, IntArray
from boltpose.training.checkpoint import load_checkpoint, save_checkpoint
from boltpose.training.hardware import denormals_as_zero
from boltpose.training.run_log import RunLog, StepRecord

Cloud = tuple[Float32Array, IntArray]
"""Inputs, (N, channels), and classes, (N,) from 0, of one sub-cloud."""

Progress = Callable[[str, int, int, float], None]
"""Called with what is being done, the step from 0, the number of steps and the loss."""

Draw = Callable[[np.random.Generator], Cloud]
"""Draws a sub-cloud; all sub-clouds of a batch have the same number of points."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitConfig:
    """How a network is fitted."""

    steps: int
    batch: int = 8
    """Sub-clouds per step and process."""
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
        for name in ("steps", "batch", "checkpoint_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be >= 1, got {getattr(self, name)}")
        for name in ("learning_rate", "clip_norm"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        for name in ("final_rate", "label_smoothing"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must be in [0, 1), got {getattr(self, name)}")
        if not 0 <= self.warmup_share <= 1:
            raise ValueError(f"warmup_share must be in [0, 1], got {self.warmup_share}")

    def rate(self, step: int) -> float:
        """Learning rate of a step, relative to `learning_rate`."""
        warmup = round(self.warmup_share * self.steps)
        if step < warmup:
            return (step + 1) / warmup
        progress = (step - warmup) / max(1, self.steps - warmup)
        return self.final_rate + (1 - self.final_rate) * (1 + math.cos(math.pi * progress)) / 2


def fit(
    network: nn.Module,
    draw: Draw,
    config: FitConfig,
    *,
    fabric: Fabric | None = None,
    checkpoint: Path | None = None,
    log: Path | None = None,
    on_step: Callable[[int, float], None] = lambda step, loss: None,
) -> float:
    """Fit a network to sub-clouds, in place, and leave it on the processor in evaluation mode.

    Every sub-cloud has a generator of its own, named by seed, step and its number in the batch of
    all processes: two processes see what one sees with twice the batch, and a resumed run sees
    what an uninterrupted one would have seen. The loss is the mean over the points of all
    processes, weighted by class. Networks with a method `penalty` have it added to the loss.

    Args:
        network: Maps inputs, (B, N, channels), to class scores, (B, N, classes).
        draw: Draws one sub-cloud.
        config: The recipe.
        fabric: Launched; one process on one processor by default.
        checkpoint: File to resume from and to write to; deleted at the end.
        log: Run folder for the losses.
        on_step: Called after every step with its number, from 0, and the loss.

    Returns:
        Mean loss of the last tenth of the steps that ran here.
    """
    hardware = Fabric(accelerator="cpu", devices=1) if fabric is None else fabric
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    start = 0
    if checkpoint is not None and checkpoint.exists():
        start = load_checkpoint(checkpoint, network, optimizer)
    model, wrapped = hardware.setup(network, optimizer)
    for state in optimizer.state.values():  # read from a checkpoint on the processor
        for name, value in state.items():
            if name != "step":
                state[name] = value.to(hardware.device)
    step_optimizer = cast("torch.optim.Optimizer", wrapped)
    weights = torch.tensor(
        config.class_weights or [1.0] * 64, dtype=torch.float32, device=hardware.device
    )
    losses: list[float] = []
    model.train()
    with ExitStack() as stack:
        stack.enter_context(denormals_as_zero())
        writer = None
        if log is not None and hardware.is_global_zero:
            writer = stack.enter_context(closing(RunLog(log, start)))
        for step in range(start, config.steps):
            for group in step_optimizer.param_groups:
                group["lr"] = config.learning_rate * config.rate(step)
            # dropout: another draw in every process, the same after a resume
            torch.manual_seed((config.seed * 1_000_003 + step) * 1024 + hardware.global_rank)
            inputs, classes = _draw_batch(draw, config, step, hardware)
            step_optimizer.zero_grad(set_to_none=True)
            with torch.autocast(hardware.device.type, torch.bfloat16, enabled=config.use_bfloat16):
                scores: Tensor = model(inputs)
            total = functional.cross_entropy(
                scores.float().flatten(0, -2),
                classes,
                weight=weights[: scores.shape[-1]],
                label_smoothing=config.label_smoothing,
                reduction="sum",
            )
            # summed over all processes, so that each point counts the same wherever it was drawn
            mass = _sum_over_processes(hardware, weights[classes].sum())
            loss = total * hardware.world_size / mass
            penalty = getattr(network, "penalty", None)
            hardware.backward(loss if penalty is None else loss + penalty())
            hardware.clip_gradients(model, step_optimizer, max_norm=config.clip_norm)
            step_optimizer.step()
            losses.append(float(_sum_over_processes(hardware, total.detach()) / mass))
            if writer is not None:
                rate = config.learning_rate * config.rate(step)
                writer.add(StepRecord(step=step, loss=losses[-1], rate=rate))
            if checkpoint is not None and (step + 1) % config.checkpoint_every == 0:
                if writer is not None:
                    writer.flush()
                if hardware.is_global_zero:
                    save_checkpoint(checkpoint, network, optimizer, step + 1)
                hardware.barrier()
            on_step(step, losses[-1])
    network.cpu().eval()
    if checkpoint is not None and hardware.is_global_zero:
        checkpoint.unlink(missing_ok=True)
    return float(np.mean(losses[-max(1, len(losses) // 10) :])) if losses else math.nan


def _draw_batch(
    draw: Draw, config: FitConfig, step: int, hardware: Fabric
) -> tuple[Tensor, Tensor]:
    """This process's share of a batch: inputs, (B, N, channels), and classes, (B * N,)."""
    first = hardware.global_rank * config.batch
    clouds = [
        draw(np.random.default_rng([config.seed, step, first + number]))
        for number in range(config.batch)
    ]
    inputs = torch.from_numpy(np.stack([cloud for cloud, _ in clouds]))
    classes = torch.from_numpy(np.concatenate([labels for _, labels in clouds]))
    return inputs.to(hardware.device), classes.to(hardware.device)


def _sum_over_processes(hardware: Fabric, value: Tensor) -> Tensor:
    if hardware.world_size == 1:
        return value
    return cast("Tensor", hardware.all_reduce(value.clone(), reduce_op="sum"))
