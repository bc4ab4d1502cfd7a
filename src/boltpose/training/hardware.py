"""Where a network is trained: one processor, one GPU, or many of either, by Lightning Fabric."""

from __future__ import annotations

import warnings
from collections.abc import Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

import torch
from lightning_fabric import Fabric
from lightning_fabric.strategies.ddp import DDPStrategy

from boltpose.errors import ConfigError

ACCELERATORS = ("cpu", "cuda", "auto")


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """What to train on. Under torchrun or SLURM every process is given the same values."""

    accelerator: str = "cpu"
    """cpu, cuda or auto. One network trains faster on a GPU; only processors give the same bits
    on every machine."""
    devices: int = 1
    """Processes per node; each draws `FitConfig.batch` clouds per step, so that the batch grows."""
    nodes: int = 1

    def __post_init__(self) -> None:
        if self.accelerator not in ACCELERATORS:
            raise ConfigError(f"accelerator must be one of {ACCELERATORS}, got {self.accelerator}")
        for name in ("devices", "nodes"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be >= 1, got {getattr(self, name)}")

    def launch(self) -> Fabric:
        """Start the processes that are missing, and join them.

        Raises:
            ConfigError: There is no such accelerator here.
        """
        prepare_torch()
        many = self.devices * self.nodes > 1
        if self.accelerator == "cuda" and not torch.cuda.is_available():
            raise ConfigError("accelerator is cuda, but PyTorch finds no GPU: use cpu or auto")
        # gloo alone works on processors; on GPUs Fabric picks nccl
        on_gpu = self.accelerator != "cpu" and torch.cuda.is_available()
        strategy = DDPStrategy(process_group_backend=None if on_gpu else "gloo") if many else "auto"
        fabric = Fabric(
            accelerator=self.accelerator,
            devices=self.devices,
            num_nodes=self.nodes,
            strategy=strategy,
        )
        with warnings.catch_warnings():
            # Fabric proposes more processes than were asked for
            warnings.simplefilter("ignore")
            fabric.launch()
        return fabric


def first_process_first(fabric: Fabric | None) -> AbstractContextManager[None]:
    """Let one process per node write files that the others then find."""
    return nullcontext() if fabric is None else fabric.rank_zero_first(local=True)


def prepare_torch() -> None:
    """One thread: sums are added in the same order on every machine."""
    torch.set_num_threads(1)


@contextmanager
def denormals_as_zero() -> Generator[None]:
    """Treat denormal numbers as zero while networks work, and only then.

    Attention turns most weights into denormals, on which processors are slow: without them
    training is 2.5 times faster. It is a state of the whole thread, though, and what else runs
    there counts on denormals: SciPy's k-d tree ends the process when built in that state.
    """
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)
