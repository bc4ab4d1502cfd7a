"""The folder of one training run, and whose it is."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from boltpose.errors import ConfigError
from boltpose.io.atomic import write_atomic

CONFIG_FILE = "config.json"
WEIGHTS_FILE = "weights.safetensors"
CHECKPOINT_FILE = "checkpoint.safetensors"


def claim_run(out: Path, described: Mapping[str, Any]) -> None:
    """Write config.json, or make sure that the one there says the same.

    Args:
        out: The run folder; it is made.
        described: All that decides the weights, JSON-ready.

    Raises:
        ConfigError: The folder holds a run with other settings.
    """
    path = out / CONFIG_FILE
    text = json.dumps(dict(described), indent=1, sort_keys=True) + "\n"
    if path.exists():
        known = json.loads(path.read_text())
        for name, value in json.loads(text).items():
            if known.get(name) != value:
                raise ConfigError(
                    f"{path}: {name} was {known.get(name)}, now {value}: choose another --out"
                )
        return
    out.mkdir(parents=True, exist_ok=True)

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)
