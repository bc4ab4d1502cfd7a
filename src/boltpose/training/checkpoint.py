"""Network, optimizer and step in one safetensors file: nothing is unpickled."""

from __future__ import annotations

from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from boltpose.errors import InputFileError


def save_checkpoint(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, step: int
) -> None:
    """Write a checkpoint; the file is complete or not there.

    Args:
        path: Where to; its folder is made.
        network: Its state is stored.
        optimizer: One parameter group over all parameters of the network.
        step: Steps done.
    """
    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    for number, state in optimizer.state_dict()["state"].items():
        for name, value in state.items():
            tensors[f"optimizer.{number}.{name}"] = torch.as_tensor(value)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    save_file(
        {name: value.detach().clone().contiguous() for name, value in tensors.items()},
        temporary,
        metadata={"step": str(step)},
    )
    temporary.replace(path)


def load_checkpoint(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer) -> int:
    """Restore network and optimizer in place; returns the steps done.

    Raises:
        InputFileError: The file is damaged or belongs to another network.
    """
    try:
        with safe_open(path, framework="pt") as file:
            step = int(file.metadata()["step"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise InputFileError(path, str(error), "a checkpoint of boltpose") from error
    try:
        network.load_state_dict(
            {
                name.removeprefix("network."): value
                for name, value in tensors.items()
                if name.startswith("network.")
            }
        )
    except RuntimeError as error:
        first_line = str(error).splitlines()[0]
        raise InputFileError(path, first_line, "a checkpoint of this network") from error
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in tensors.items():
        if name.startswith("optimizer."):
            _, number, key = name.split(".")
            state.setdefault(int(number), {})[key] = value
    optimizer.load_state_dict(
        {"state": state, "param_groups": optimizer.state_dict()["param_groups"]}
    )
    return step
