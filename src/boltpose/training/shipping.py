"""From run folders to the networks that are shipped and evaluated."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from boltpose.errors import InputFileError
from boltpose.io.atomic import write_atomic
from boltpose.segmentation.models import PARTS_FILE, PARTS_LOCAL_FILE, SCENE_FILE, SCENE_LOCAL_FILE
from boltpose.training.run_folder import CONFIG_FILE
from boltpose.training.runs import METRICS_FILE

ALL_MOTORS = "shipped"
"""Name of the run folder without a family left out."""

_FILES = {"parts": (PARTS_LOCAL_FILE, PARTS_FILE), "scene": (SCENE_LOCAL_FILE, SCENE_FILE)}


def ship_models(
    runs: dict[str, Path], folder: Path, shipped: Path, families: Sequence[str]
) -> Iterator[Path]:
    """Copy networks and metrics from the run folders of `boltpose train`.

    Args:
        runs: By task, parts and scene: a folder with a run folder per family left out, and one
            named `ALL_MOTORS`.
        folder: Where the networks with a family left out go, a folder each.
        shipped: Where those of all motors go.
        families: Families left out.

    Yields:
        Every folder that was filled.

    Raises:
        InputFileError: A run folder is missing or not finished.
    """
    for task, root in runs.items():
        for name in (*families, ALL_MOTORS):
            for file in (*_FILES[task], CONFIG_FILE, *((METRICS_FILE,) * (name != ALL_MOTORS))):
                if not (root / name / file).is_file():
                    raise InputFileError(root / name, f"no {file}", "a finished run folder")
    for name in (*families, ALL_MOTORS):
        place = shipped if name == ALL_MOTORS else folder / name
        place.mkdir(parents=True, exist_ok=True)
        metrics: dict[str, Any] = {}
        for task, root in runs.items():
            for file in _FILES[task]:
                _copy(root / name / file, place / file)
            if name != ALL_MOTORS:
                metrics |= json.loads((root / name / METRICS_FILE).read_text())
        if metrics:
            _write(place / METRICS_FILE, json.dumps(metrics, indent=1, sort_keys=True) + "\n")
        yield place


def _copy(source: Path, target: Path) -> None:
    def write(stream: BinaryIO) -> None:
        with source.open("rb") as content:
            shutil.copyfileobj(content, stream)

    write_atomic(target, write)


def _write(path: Path, text: str) -> None:
    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)
