"""A run folder to a file that labels the demo motor as the network itself does."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch

import boltpose
from boltpose.datasets.part_clouds import scan_normals
from boltpose.errors import InputFileError
from boltpose.io.scan import read_scan
from boltpose.networks.backbones import build_backbone
from boltpose.segmentation.models import load_models
from boltpose.segmentation.plain import PlainPartPredictor, describe_scan, input_columns
from boltpose.segmentation.voting import split_randomly
from boltpose.training import export_run as exporting
from boltpose.training.export import Agreement, round_to_half
from boltpose.training.export_run import TRACED_WITH, check_samples, export_run
from boltpose.training.plain import WEIGHTS_FILE, PlainConfig, load_plain
from boltpose.training.weights import save_weights
from tests.support.small_networks import pretend_training

CONFIG = PlainConfig(backbone="pct-small", inputs="normals", points=256)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder whose network has learned nothing."""
    folder = tmp_path_factory.mktemp("run")
    torch.manual_seed(0)
    network = build_backbone("pct-small", inputs=6, classes=6)
    pretend_training(network, torch.randn(2, 64, 6))
    save_weights(folder / WEIGHTS_FILE, network, {**asdict(CONFIG), "motors": ["motor_000"]})
    return folder


def test_the_file_labels_a_scan_as_the_network_does(run: Path) -> None:
    report = export_run(run)
    assert report.path == run / "parts.onnx"
    assert report.kind == "parts_plain"
    assert report.agreement.largest < 1e-5
    assert report.file_bytes == report.path.stat().st_size
    assert len(report.sizes) >= 3
    assert TRACED_WITH not in report.sizes

    points = read_scan(Path(boltpose.__file__).parent / "demo" / "full_scan.ply").points[::40]
    normals = scan_normals(points)
    predictor = load_models(run).parts
    assert isinstance(predictor, PlainPartPredictor)
    found = predictor.predict(points, normals).probabilities

    network, _ = load_plain(run)
    round_to_half(network)
    order = np.lexsort(points.T)
    rows = describe_scan(points[order], normals[order], "normals")[1]
    wanted = np.zeros((len(points), 6))
    for group in split_randomly(len(points), 256, np.random.default_rng([0, 0])):
        with torch.inference_mode():
            scores = network(torch.from_numpy(rows[group])[None])[0]
        wanted[order[group]] = torch.softmax(scores, dim=1).numpy()
    np.testing.assert_allclose(found, wanted, atol=1e-4)
    np.testing.assert_array_equal(found.argmax(axis=1), wanted.argmax(axis=1))


@pytest.mark.parametrize("difference", [1.01e-3, float("nan")])
def test_a_file_that_differs_is_not_written(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, difference: float
) -> None:
    monkeypatch.setattr(exporting, "build_onnx", lambda *_, **__: b"")
    found = Agreement(largest=difference, usual=0.0, same_label=1.0)
    monkeypatch.setattr(exporting, "content_agreement", lambda *_: found)
    with pytest.raises(InputFileError, match="nothing was written") as told:
        export_run(run, tmp_path / "net.onnx")
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_weights_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"weights\.safetensors: found no file"):
        export_run(tmp_path)
    (tmp_path / WEIGHTS_FILE).write_bytes(b"no weights")
    with pytest.raises(InputFileError, match=r"weights\.safetensors"):
        export_run(tmp_path)


@pytest.mark.parametrize(("task", "inputs"), [("parts", "xyz"), ("scene", "features")])
def test_checks_are_of_sizes_not_traced_with(task: str, inputs: str) -> None:
    config = PlainConfig(task=task, inputs=inputs, points=TRACED_WITH[1])
    samples = check_samples(config)
    assert len(samples) >= 3
    for sample in samples:
        assert sample.dtype == np.float32
        assert sample.shape[2] == len(input_columns(task, inputs))
        assert sample.shape[1] != TRACED_WITH[1]
        assert np.isfinite(sample).all()
