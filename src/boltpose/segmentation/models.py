"""The networks of one folder, ready to be handed to the stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from boltpose.errors import InputFileError
from boltpose.segmentation.parts import OnnxPartPredictor
from boltpose.segmentation.predictor import PartPredictor, ScenePredictor
from boltpose.segmentation.scene import OnnxScenePredictor

SHIPPED_WEIGHTS = Path(__file__).parent / "weights"
"""Networks trained on all motors of reman18; see the model cards there."""

PARTS_LOCAL_FILE = "parts_local.onnx"
PARTS_FILE = "parts.onnx"
SCENE_LOCAL_FILE = "scene_local.onnx"
SCENE_FILE = "scene.onnx"


@dataclass(frozen=True, slots=True, kw_only=True)
class Models:
    """Whatever labels full scans and views; put your own predictors here."""

    parts: PartPredictor
    scene: ScenePredictor
    hashes: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of every network's file, by file name; for provenance."""


def load_models(folder: Path | None = None) -> Models:
    """Load the networks of a folder; they are opened on first use.

    Args:
        folder: Holds {parts,scene}{_local,}.onnx; the shipped ones by default.

    Returns:
        The models.

    Raises:
        InputFileError: A file is missing. A damaged one is told on first use.
    """
    place = SHIPPED_WEIGHTS if folder is None else Path(folder)
    if not place.is_dir():
        raise InputFileError(place, "no folder", "a folder with the networks of boltpose")
    parts = OnnxPartPredictor(place / PARTS_LOCAL_FILE, place / PARTS_FILE)
    scene = OnnxScenePredictor(place / SCENE_LOCAL_FILE, place / SCENE_FILE)
    networks = (parts.local, parts.context, scene.local, scene.context)
    return Models(
        parts=parts,
        scene=scene,
        hashes={network.path.name: network.sha256 for network in networks},
    )
