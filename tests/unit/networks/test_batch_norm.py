from __future__ import annotations

from pathlib import Path

import pytest
import torch
from torch import Tensor, distributed, nn
from torch.multiprocessing.spawn import spawn

from boltpose.networks.batch_norm import SharedBatchNorm1d

CHANNELS = 5
SPLITS = {"halves": (3, 3), "uneven": (5, 1)}


def _network(norm: type[nn.BatchNorm1d], momentum: float | None) -> nn.Sequential:
    """Normalises over points (B, C, N), then over clouds (B, C)."""
    torch.manual_seed(1)
    network = nn.Sequential(
        nn.Conv1d(3, CHANNELS, 1),
        norm(CHANNELS, momentum=momentum),
        nn.Tanh(),
        nn.AdaptiveMaxPool1d(1),
        nn.Flatten(),
        norm(CHANNELS, momentum=momentum),
        nn.Tanh(),
    )
    for parameter in network.parameters():
        nn.init.normal_(parameter)
    return network.double()


def _inputs() -> Tensor:
    generator = torch.Generator().manual_seed(2)
    # a large mean: statistics as E[x^2] - E[x]^2 would lose digits
    return torch.randn(6, 3, 20, generator=generator, dtype=torch.float64) + 30


def _pass(network: nn.Module, inputs: Tensor) -> dict[str, Tensor]:
    """Output, gradients and state after two training steps' forward passes."""
    inputs = inputs.clone().requires_grad_()
    network(inputs.detach() * 2)  # running statistics see two batches
    output = network(inputs)
    output.sin().sum().backward()
    found = {"output": output.detach(), "input gradient": inputs.grad}
    found |= {f"gradient {name}": value.grad for name, value in network.named_parameters()}
    found |= {f"state {name}": value for name, value in network.named_buffers()}
    return {name: value for name, value in found.items() if value is not None}


def _work(rank: int, folder: Path) -> None:
    torch.set_num_threads(1)
    distributed.init_process_group(
        "gloo", init_method=f"file://{folder / 'meet'}", rank=rank, world_size=2
    )
    for momentum in (0.1, None):
        for name, split in SPLITS.items():
            part = _inputs().split(split)[rank]
            found = _pass(_network(SharedBatchNorm1d, momentum), part)
            torch.save(found, folder / f"{name}-{momentum}-{rank}.pt")
    distributed.destroy_process_group()


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("processes")
    spawn(_work, args=(folder,), nprocs=2)
    return folder


@pytest.mark.parametrize("momentum", [0.1, None])
@pytest.mark.parametrize("split", SPLITS)
def test_two_processes_are_one_with_the_whole_batch(
    results: Path, split: str, momentum: float | None
) -> None:
    wanted = _pass(_network(nn.BatchNorm1d, momentum), _inputs())
    first, second = (torch.load(results / f"{split}-{momentum}-{rank}.pt") for rank in (0, 1))
    assert first.keys() == wanted.keys()
    for name, value in wanted.items():
        if name in ("output", "input gradient"):
            got = torch.cat([first[name], second[name]])
        elif name.startswith("gradient"):
            got = first[name] + second[name]  # what data-parallel training sums
        else:
            torch.testing.assert_close(first[name], second[name], atol=0, rtol=0)
            got = first[name]
        torch.testing.assert_close(got, value, atol=1e-10, rtol=1e-10, msg=name)


def test_alone_it_is_the_plain_one() -> None:
    wanted = _pass(_network(nn.BatchNorm1d, 0.1), _inputs())
    got = _pass(_network(SharedBatchNorm1d, 0.1), _inputs())
    assert got.keys() == wanted.keys()
    for name, value in wanted.items():
        torch.testing.assert_close(got[name], value, atol=0, rtol=0, msg=name)
