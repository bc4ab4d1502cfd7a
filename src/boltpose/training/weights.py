"""Trained weights on disk: safetensors, with what they were trained with; nothing is unpickled."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from boltpose import __version__
from boltpose.errors import InputFileError
from boltpose.io.source_commit import source_commit

_WANTED = "weights of a boltpose network (.safetensors)"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Weights:
    """Weights and where they come from."""

    path: Path
    tensors: Mapping[str, Tensor]
    settings: Mapping[str, Any]
    """The recipe and the motors."""
    commit: str
    """Git commit of the code that trained them, `+` if it was changed; empty if unknown."""

    @property
    def sha256(self) -> str:
        """Hash of the file."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()


def save_weights(path: Path, network: nn.Module, settings: Mapping[str, Any]) -> None:
    """Write the state of a network and the settings it was trained with; whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    save_file(
        {name: value.detach().cpu().contiguous() for name, value in network.state_dict().items()},
        temporary,
        metadata={
            "settings": json.dumps(dict(settings), sort_keys=True),
            "boltpose": __version__,
            "commit": source_commit(),
        },
    )
    temporary.replace(path)


def read_weights(path: Path) -> Weights:
    """Read what `save_weights` wrote.

    Raises:
        InputFileError: There is no such file, it is damaged, or of something else.
    """
    if not path.is_file():
        raise InputFileError(path, "no file", _WANTED)
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        settings = json.loads(metadata["settings"])
    except (SafetensorError, KeyError, ValueError) as error:
        raise InputFileError(path, " ".join(str(error).split()), _WANTED) from error
    return Weights(path=path, tensors=tensors, settings=settings, commit=metadata.get("commit", ""))


def load_into(network: nn.Module, path: Path) -> None:
    """Put the weights of a file into a network of the same shape.

    Raises:
        InputFileError: They belong to another network.
    """
    found = read_weights(path)
    own = network.state_dict()
    for name in sorted(set(own) | set(found.tensors)):
        here = tuple(own[name].shape) if name in own else "nothing"
        there = tuple(found.tensors[name].shape) if name in found.tensors else "nothing"
        if here != there:
            raise InputFileError(path, f"{name} of {there}", f"{name} of {here}")
    network.load_state_dict(dict(found.tensors))
