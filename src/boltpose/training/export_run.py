"""A trained run folder to ONNX, checked on sub-clouds of a real-looking scan."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from torch import nn

from boltpose.arrays import Float32Array
from boltpose.datasets.part_clouds import scan_normals
from boltpose.errors import InputFileError
from boltpose.io.scan import read_scan
from boltpose.networks.dgcnn import Dgcnn
from boltpose.networks.pointnet2 import PointNet2
from boltpose.segmentation.models import PARTS_FILE, SCENE_FILE
from boltpose.segmentation.plain import (
    LEAST_POINTS,
    PARTS_PLAIN,
    SCENE_PLAIN,
    describe_scan,
    input_columns,
)
from boltpose.segmentation.scene_features import compute_scene_features
from boltpose.training.export import (
    Agreement,
    build_onnx,
    content_agreement,
    round_to_half,
    write_onnx,
)
from boltpose.training.plain import WEIGHTS_FILE, PlainConfig, load_plain

LIMIT = 1e-3
"""Largest difference of class probabilities between a file and its network."""

DYNAMIC_LIMIT = 5e-3
"""The same at 99 of 100 points for networks that search neighbours among their own features
(DGCNN): the last digit decides which of two as near is taken, and that point's answer jumps."""

DYNAMIC_SAME_LABEL = 0.995
"""Of such networks, share of points whose label must be the same."""

TRACED_WITH = (2, 640)
"""Clouds and points; no check has these sizes."""

_DEMO = Path(__file__).resolve().parents[1] / "demo"
"""A simulated motor that comes with the package."""

_STRIDE = 5
"""Every so many points of its scans are enough to draw sub-clouds from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportReport:
    """What was written, and how well it agrees."""

    path: Path
    kind: str
    backbone: str
    sizes: tuple[tuple[int, int], ...]
    """Clouds and points of every check."""
    agreement: Agreement
    """Over all checks."""
    file_bytes: int


def export_run(run: Path, out: Path | None = None, *, half: bool = True) -> ExportReport:
    """Write the network of a run folder as ONNX, if the file agrees with it.

    Args:
        run: Folder of `train_plain`, or its weights.
        out: The file; parts.onnx or scene.onnx beside the weights by default, where
            `load_models` finds it.
        half: Store large constants with 16 bits. The file is compared with the network rounded
            in the same way.

    Raises:
        InputFileError: There are no weights of a plain network, or the file would differ by more
            than `LIMIT` (of DGCNN: `DYNAMIC_LIMIT`); then nothing is written.
    """
    weights = run / WEIGHTS_FILE if run.is_dir() else run
    network, config = load_plain(weights)
    if half:
        round_to_half(network)
    columns = len(input_columns(config.task, config.inputs))
    kind = PARTS_PLAIN if config.task == "parts" else SCENE_PLAIN
    content = build_onnx(
        network,
        kind=kind,
        settings=_settings(network, config, columns),
        sample_shape=(*TRACED_WITH, columns),
        half=half,
    )
    samples = check_samples(config)
    found = content_agreement(network, content, kind, samples)
    if isinstance(network, Dgcnn):
        difference, limit = found.usual, DYNAMIC_LIMIT
        agrees = difference <= limit and found.same_label >= DYNAMIC_SAME_LABEL
    else:
        difference, limit = found.largest, LIMIT
        agrees = difference <= limit
    if not agrees:
        text = (
            f"a network whose file would give probabilities {difference:.1e} away, "
            f"{100 * found.same_label:.2f} % of the labels the same"
        )
        raise InputFileError(weights, text, f"at most {limit:.0e} away; nothing was written")
    name = PARTS_FILE if config.task == "parts" else SCENE_FILE
    path = weights.parent / name if out is None else out
    write_onnx(path, content)
    return ExportReport(
        path=path,
        kind=kind,
        backbone=config.backbone,
        sizes=tuple((len(sample), sample.shape[1]) for sample in samples),
        agreement=found,
        file_bytes=len(content),
    )


def check_samples(config: PlainConfig) -> tuple[Float32Array, ...]:
    """Sub-clouds to compare a file and its network on; none has the size it was traced with.

    Args:
        config: What the network reads.

    Returns:
        Shape (clouds, points, columns) each: one sub-cloud of the demo scan of the trained size,
        three smaller ones, the smallest cloud that is labelled, and one far from all training.
    """
    rows = _demo_rows(config)
    rng = np.random.default_rng(0)

    def draw(clouds: int, points: int) -> Float32Array:
        few = len(rows) < points
        index = [rng.choice(len(rows), size=points, replace=few) for _ in range(clouds)]
        return rows[np.stack(index)]

    points = config.points if config.points != TRACED_WITH[1] else config.points + 1
    noise = rng.normal(scale=2.0, size=(2, 3 * LEAST_POINTS + 7, rows.shape[1]))
    return (
        draw(1, max(points, LEAST_POINTS)),
        draw(3, 777),
        draw(1, LEAST_POINTS),
        noise.astype(np.float32),
    )


def _demo_rows(config: PlainConfig) -> Float32Array:
    """What a network reads of the demo motor's full scan or view, (N, columns)."""
    if config.task == "parts":
        points = read_scan(_DEMO / "full_scan.ply").points[::_STRIDE]
        return describe_scan(points, scan_normals(points), config.inputs)[1]
    view = read_scan(_DEMO / "000002.png", camera=_DEMO / "scene_camera.json")
    described = compute_scene_features(view.points[::_STRIDE])
    return described.features[:, input_columns("scene", config.inputs)]


def _settings(network: nn.Module, config: PlainConfig, columns: int) -> dict[str, Any]:
    settings: dict[str, Any] = {
        "backbone": config.backbone,
        "inputs": config.inputs,
        "columns": columns,
        "sub_cloud": max(config.points, LEAST_POINTS),
        "temperature": 1.0,
    }
    if isinstance(network, PointNet2):
        settings["centres"] = list(network.config.centres)
    return settings
