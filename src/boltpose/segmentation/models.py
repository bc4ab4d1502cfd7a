"""The networks of one folder, ready to be handed to the stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from boltpose.errors import InputFileError
from boltpose.segmentation.onnx_session import OnnxNetwork
from boltpose.segmentation.parts import OnnxPartPredictor
from boltpose.segmentation.plain import (
    PARTS_PLAIN,
    SCENE_PLAIN,
    PlainPartPredictor,
    PlainScenePredictor,
)
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
    """Load the networks of a folder.

    Args:
        folder: The shipped networks by default. Each of the two tasks may be there as two stages
            (`parts_local.onnx` and `parts.onnx`), as one plain network (`parts.onnx`, as
            `boltpose export` writes it) or not at all: then the shipped networks do that task.
            A run folder of `boltpose train` is such a folder once it is exported.

    Returns:
        The models. They are opened on first use.

    Raises:
        InputFileError: There is no such folder, no network in it, or a file that belongs to the
            other ones is missing. A damaged file is told here or on first use.
    """
    place = SHIPPED_WEIGHTS if folder is None else Path(folder)
    if not place.is_dir():
        raise InputFileError(place, "no folder", "a folder with the networks of boltpose")
    names = (PARTS_LOCAL_FILE, PARTS_FILE, SCENE_LOCAL_FILE, SCENE_FILE)
    if not any((place / name).is_file() for name in names):
        raise InputFileError(place, "no network", f"{PARTS_FILE} or {SCENE_FILE} (boltpose export)")
    parts, part_networks = _load_parts(place)
    scene, scene_networks = _load_scene(place)
    networks = (*part_networks, *scene_networks)
    return Models(
        parts=parts,
        scene=scene,
        hashes={network.path.name: network.sha256 for network in networks},
    )


def _load_parts(folder: Path) -> tuple[PartPredictor, tuple[OnnxNetwork, ...]]:
    folder, is_plain = _choose(folder, PARTS_LOCAL_FILE, PARTS_FILE, PARTS_PLAIN)
    if is_plain:
        plain = PlainPartPredictor(folder / PARTS_FILE)
        return plain, (plain.network,)
    staged = OnnxPartPredictor(folder / PARTS_LOCAL_FILE, folder / PARTS_FILE)
    return staged, (staged.local, staged.context)


def _load_scene(folder: Path) -> tuple[ScenePredictor, tuple[OnnxNetwork, ...]]:
    folder, is_plain = _choose(folder, SCENE_LOCAL_FILE, SCENE_FILE, SCENE_PLAIN)
    if is_plain:
        plain = PlainScenePredictor(folder / SCENE_FILE)
        return plain, (plain.network,)
    staged = OnnxScenePredictor(folder / SCENE_LOCAL_FILE, folder / SCENE_FILE)
    return staged, (staged.local, staged.context)


def _choose(folder: Path, local: str, main: str, plain_kind: str) -> tuple[Path, bool]:
    """Folder of a task's networks, and whether it is one plain network.

    Raises:
        InputFileError: The only file of the task is no network, or one of something else.
    """
    has_local, has_main = (folder / local).is_file(), (folder / main).is_file()
    if not has_local and not has_main:
        return SHIPPED_WEIGHTS, False
    if folder == SHIPPED_WEIGHTS or not has_main:
        return folder, False
    network = OnnxNetwork(folder / main, plain_kind)
    if has_local or network.found_kind == main.removesuffix(".onnx"):
        # of two stages; a stage that is missing is told by the predictor
        return folder, network.found_kind == plain_kind
    network.check_kind()
    return folder, True
