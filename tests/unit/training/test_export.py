from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.point_mlp import PointMlp, PointMlpConfig
from boltpose.segmentation.onnx_session import OnnxNetwork, softmax
from boltpose.training.calibration import set_temperature
from boltpose.training.export import export_onnx, round_to_half


@pytest.fixture(scope="module")
def pct(tmp_path_factory: pytest.TempPathFactory) -> tuple[Pct, Path]:
    torch.manual_seed(0)
    network = Pct(PctConfig(inputs=9, classes=4, channels=32, layers=2, embedding=64))
    network.set_standardisation(torch.randn(9), torch.rand(9) + 0.5)
    round_to_half(network)
    path = tmp_path_factory.mktemp("export") / "pct.onnx"
    export_onnx(network, path, kind="parts", settings={"inputs": 9}, sample_shape=(2, 64, 9))
    return network, path


@pytest.mark.parametrize("shape", [(1, 37, 9), (3, 500, 9)])
def test_onnx_pct_equals_torch_at_other_sizes(
    pct: tuple[Pct, Path], shape: tuple[int, int, int]
) -> None:
    network, path = pct
    inputs = torch.randn(shape)
    with torch.inference_mode():
        wanted = network(inputs).numpy()
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    got = np.asarray(session.run(["logits"], {"inputs": inputs.numpy()})[0])
    np.testing.assert_allclose(got, wanted, atol=1e-4)


@pytest.mark.parametrize("rows", [1, 333])
def test_onnx_mlp_equals_torch_at_other_sizes(rows: int, tmp_path: Path) -> None:
    torch.manual_seed(1)
    network = PointMlp(PointMlpConfig(inputs=12, classes=6, hidden=64))
    round_to_half(network)
    path = tmp_path / "mlp.onnx"
    largest = export_onnx(network, path, kind="x", settings={}, sample_shape=(8, 12))
    inputs = torch.randn(rows, 12)
    with torch.inference_mode():
        wanted = network(inputs).numpy()
    np.testing.assert_allclose(OnnxNetwork(path, "x").run(inputs.numpy()), wanted, atol=1e-4)
    assert largest < 1e-4


def test_large_constants_take_two_bytes(pct: tuple[Pct, Path]) -> None:
    network, path = pct
    numbers = sum(parameter.numel() for parameter in network.parameters())
    assert path.stat().st_size < 3.5 * numbers


def test_the_file_tells_nothing_of_the_training_machine(pct: tuple[Pct, Path]) -> None:
    assert b"/work" not in pct[1].read_bytes()
    assert b"site-packages" not in pct[1].read_bytes()


def test_the_temperature_is_stored_beside_the_settings(
    pct: tuple[Pct, Path], tmp_path: Path
) -> None:
    path = tmp_path / "copy.onnx"
    path.write_bytes(pct[1].read_bytes())
    assert OnnxNetwork(path, "parts").temperature == 1.0

    set_temperature(path, 1.37)

    changed = OnnxNetwork(path, "parts")
    assert changed.temperature == 1.37
    assert changed.settings["inputs"] == 9
    inputs = np.ones((1, 5, 9), dtype=np.float32)
    np.testing.assert_array_equal(changed.run(inputs), OnnxNetwork(pct[1], "parts").run(inputs))


def test_softmax_rows_are_probabilities() -> None:
    logits = np.array([[1e4, -1e4, 0.0], [0.0, 0.0, 0.0]], dtype=np.float32)
    rows = softmax(logits)
    np.testing.assert_allclose(rows, [[1, 0, 0], [1 / 3, 1 / 3, 1 / 3]], atol=1e-6)
