from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest

from boltpose.errors import InputFileError
from boltpose.segmentation.models import SHIPPED_WEIGHTS, load_models
from boltpose.segmentation.parts import OnnxPartPredictor
from boltpose.segmentation.plain import PlainPartPredictor, PlainScenePredictor
from boltpose.segmentation.scene import OnnxScenePredictor
from tests.support.onnx_files import write_linear_network

FILES = ("parts_local.onnx", "parts.onnx", "scene_local.onnx", "scene.onnx")


def test_shipped_networks_are_small_and_hashed() -> None:
    models = load_models()
    assert set(models.hashes) == set(FILES)
    assert all(len(value) == 64 for value in models.hashes.values())
    for name in FILES:
        assert (SHIPPED_WEIGHTS / name).stat().st_size < 2_000_000


@pytest.mark.parametrize("name", ["parts", "scene"])
def test_model_cards_name_the_files_they_describe(name: str) -> None:
    card = (SHIPPED_WEIGHTS / f"{name}.md").read_text()
    for file, value in load_models().hashes.items():
        if file.startswith(name):
            assert value in card, f"{name}.md does not hold the hash of {file}"
    assert "simulated" in card


def test_a_folder_without_networks_is_told(tmp_path: Path) -> None:
    with pytest.raises(
        InputFileError, match=r"found no network, wanted parts\.onnx or scene\.onnx"
    ):
        load_models(tmp_path)
    with pytest.raises(InputFileError, match="no folder"):
        load_models(tmp_path / "nowhere")


@pytest.mark.parametrize("missing", FILES)
def test_a_missing_stage_is_told(tmp_path: Path, missing: str) -> None:
    for name in FILES:
        if name != missing:
            shutil.copy(SHIPPED_WEIGHTS / name, tmp_path / name)
    with pytest.raises(InputFileError, match=rf"{missing}: found no file"):
        load_models(tmp_path)


def test_both_stages_of_a_folder_are_used_as_they_are(tmp_path: Path) -> None:
    for name in FILES:
        shutil.copy(SHIPPED_WEIGHTS / name, tmp_path / name)
    models = load_models(tmp_path)
    assert isinstance(models.parts, OnnxPartPredictor)
    assert models.parts.local.path == tmp_path / "parts_local.onnx"
    assert isinstance(models.scene, OnnxScenePredictor)
    assert models.hashes == load_models().hashes


def _plain(path: Path, kind: str) -> str:
    """Write a plain network; returns its hash."""
    classes = 6 if kind == "parts_plain" else 2
    write_linear_network(path, kind, np.ones((3, classes)), {"inputs": "xyz"})
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_run_folder_brings_its_own_parts_and_the_shipped_scene(tmp_path: Path) -> None:
    own = _plain(tmp_path / "parts.onnx", "parts_plain")
    models = load_models(tmp_path)
    assert isinstance(models.parts, PlainPartPredictor)
    assert isinstance(models.scene, OnnxScenePredictor)
    assert models.scene.context.path == SHIPPED_WEIGHTS / "scene.onnx"
    shipped = load_models().hashes
    assert models.hashes == {
        "parts.onnx": own,
        "scene_local.onnx": shipped["scene_local.onnx"],
        "scene.onnx": shipped["scene.onnx"],
    }


def test_a_run_folder_brings_its_own_scene_and_the_shipped_parts(tmp_path: Path) -> None:
    own = _plain(tmp_path / "scene.onnx", "scene_plain")
    models = load_models(tmp_path)
    assert isinstance(models.scene, PlainScenePredictor)
    assert isinstance(models.parts, OnnxPartPredictor)
    assert models.hashes["scene.onnx"] == own
    assert set(models.hashes) == {"parts_local.onnx", "parts.onnx", "scene.onnx"}
    assert models.scene.predict(np.random.default_rng(0).uniform(0, 99, (50, 3))).shape == (50,)


def test_the_kind_decides_where_a_first_stage_was_left_behind(tmp_path: Path) -> None:
    shutil.copy(SHIPPED_WEIGHTS / "parts_local.onnx", tmp_path)
    own = _plain(tmp_path / "parts.onnx", "parts_plain")
    models = load_models(tmp_path)
    assert isinstance(models.parts, PlainPartPredictor)
    assert models.hashes["parts.onnx"] == own
    assert "parts_local.onnx" not in models.hashes


@pytest.mark.parametrize("name", ["parts.onnx", "scene.onnx"])
def test_a_damaged_network_is_told_in_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"not a network")
    with pytest.raises(InputFileError, match="wanted a readable ONNX network") as told:
        load_models(tmp_path)
    assert str(told.value).startswith(str(tmp_path / name))
    assert "\n" not in str(told.value)


def test_a_damaged_first_stage_is_told_on_use(tmp_path: Path) -> None:
    for name in FILES:
        shutil.copy(SHIPPED_WEIGHTS / name, tmp_path / name)
    for name in ("parts_local.onnx", "scene_local.onnx"):
        (tmp_path / name).write_bytes(b"not a network")
    models = load_models(tmp_path)
    with pytest.raises(InputFileError, match=r"scene_local\.onnx"):
        models.scene.predict(np.zeros((10, 3)))
    with pytest.raises(InputFileError, match=r"parts_local\.onnx"):
        models.parts.predict(np.zeros((200, 3)), np.zeros((200, 3)))


def test_a_network_of_another_kind_is_refused(tmp_path: Path) -> None:
    for name in FILES:
        shutil.copy(SHIPPED_WEIGHTS / "parts.onnx", tmp_path / name)
    with pytest.raises(
        InputFileError, match="found kind 'parts', wanted a network of kind 'scene_local'"
    ):
        load_models(tmp_path).scene.predict(np.zeros((10, 3)))


def test_a_plain_network_of_the_other_task_is_refused(tmp_path: Path) -> None:
    _plain(tmp_path / "scene.onnx", "parts_plain")
    with pytest.raises(
        InputFileError, match="found kind 'parts_plain', wanted a network of kind 'scene_plain'"
    ):
        load_models(tmp_path)


def test_a_network_of_somebody_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "parts.onnx"
    _plain(path, "parts_plain")
    model = onnx.load(path)
    del model.metadata_props[:]
    onnx.save(model, path)
    with pytest.raises(
        InputFileError, match="found kind 'unknown', wanted a network of kind 'parts_plain'"
    ):
        load_models(tmp_path)


def test_prediction_needs_no_torch() -> None:
    script = (
        "import sys; import numpy as np; from boltpose.segmentation.models import load_models;"
        "load_models().scene.predict(np.random.default_rng(0).uniform(0, 300, (3000, 3)));"
        "assert not {'torch', 'onnx'} & set(sys.modules), 'imported'"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
