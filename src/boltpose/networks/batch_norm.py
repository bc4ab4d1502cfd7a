"""Batch normalisation over the clouds of all training processes."""

from __future__ import annotations

from typing import Any, cast

import torch
from torch import Tensor, distributed, nn


class _SumOverProcesses(torch.autograd.Function):
    """Sum of a tensor over all processes; its gradient is the sum of their gradients."""

    @staticmethod
    def forward(ctx: Any, local: Tensor) -> Tensor:  # torch's signature
        total = local.clone(memory_format=torch.contiguous_format)
        distributed.all_reduce(total)
        return total

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:
        total = gradients[0].clone(memory_format=torch.contiguous_format)
        distributed.all_reduce(total)
        return total


class SharedBatchNorm1d(nn.BatchNorm1d):
    """`nn.BatchNorm1d` whose training statistics are those of the batches of all processes.

    `nn.SyncBatchNorm` does the same on GPUs and refuses CPUs. Alone, or in evaluation, this is
    `nn.BatchNorm1d` itself; the state has the same keys, so either loads the other's weights.
    Every process must pass through the layer in the same order, as data-parallel training does.
    """

    def forward(self, input: Tensor) -> Tensor:
        """Normalise channels.

        Args:
            input: Shape (B, C) or (B, C, N).

        Returns:
            Same shape and dtype.

        Raises:
            ValueError: Other number of dimensions, or a single value per channel in training.
        """
        if not self.training or not is_distributed():
            return super().forward(input)
        self._check_input_dim(input)
        return self._forward_shared(input)

    def _forward_shared(self, input: Tensor) -> Tensor:
        axes = [0] if input.dim() == 2 else [0, 2]
        # statistics in float32 at least, also under autocast
        values = input.to(torch.promote_types(input.dtype, torch.float32))
        count = values.new_full((1,), values.numel() // values.shape[1])
        # centred second moments in a second exchange: E[x^2] - E[x]^2 would cancel
        first = cast(Tensor, _SumOverProcesses.apply(torch.cat([values.sum(axes), count])))
        total = first[-1].detach()
        if total <= 1:
            raise ValueError("training needs more than one value per channel")
        mean = first[:-1] / total
        shape = [1, -1] + [1] * (input.dim() - 2)
        centred = values - mean.view(shape)
        second = cast(Tensor, _SumOverProcesses.apply(centred.square().sum(axes)))
        variance = second / total
        self._update_running(mean.detach(), (second / (total - 1)).detach())
        normal = centred * torch.rsqrt(variance + self.eps).view(shape)
        if self.affine:
            normal = normal * self.weight.view(shape) + self.bias.view(shape)
        return normal.to(input.dtype)

    def _update_running(self, mean: Tensor, variance: Tensor) -> None:
        if self.running_mean is None or self.running_var is None:
            return
        if self.num_batches_tracked is None:
            raise RuntimeError("running statistics without a count of batches")
        self.num_batches_tracked.add_(1)
        share = self.momentum
        if share is None:  # cumulative average
            share = 1.0 / float(self.num_batches_tracked)
        self.running_mean.lerp_(mean, share)
        self.running_var.lerp_(variance, share)


def is_distributed() -> bool:
    """Whether several processes train together."""
    return (
        distributed.is_available()
        and distributed.is_initialized()
        and distributed.get_world_size() > 1
    )
