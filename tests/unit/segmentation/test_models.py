from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.segmentation.models import SHIPPED_WEIGHTS, load_models

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


def test_a_missing_network_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"parts_local\.onnx: found no file"):
        load_models(tmp_path)
    with pytest.raises(InputFileError, match="no folder"):
        load_models(tmp_path / "nowhere")


def test_a_damaged_network_is_told_on_use(tmp_path: Path) -> None:
    for name in FILES:
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


def test_prediction_needs_no_torch() -> None:
    script = (
        "import sys; import numpy as np; from boltpose.segmentation.models import load_models;"
        "load_models().scene.predict(np.random.default_rng(0).uniform(0, 300, (3000, 3)));"
        "assert not {'torch', 'onnx'} & set(sys.modules), 'imported'"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
