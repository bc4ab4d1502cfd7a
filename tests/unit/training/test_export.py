from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from boltpose.networks.backbones import BACKBONES
from boltpose.networks.pct import Pct, PctConfig
from boltpose.networks.point_mlp import PointMlp, PointMlpConfig
from boltpose.networks.pointnet2 import PointNet2
from boltpose.networks.segmentation_network import SegmentationNetwork
from boltpose.segmentation.onnx_session import OnnxNetwork, softmax
from boltpose.training.calibration import set_temperature
from boltpose.training.export import (
    agreement,
    build_onnx,
    export_onnx,
    largest_difference,
    round_to_half,
)
from tests.support.small_networks import pretend_training, small_network

COLUMNS = 6
CLASSES = 6

Exported = Callable[[str], tuple[SegmentationNetwork, Path]]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """Networks and their files, each made once."""
    made: dict[str, tuple[SegmentationNetwork, Path]] = {}

    def get(backbone: str) -> tuple[SegmentationNetwork, Path]:
        if backbone not in made:
            network = small_network(backbone, inputs=COLUMNS, classes=CLASSES)
            round_to_half(network)
            settings = {"centres": [512, 128]} if isinstance(network, PointNet2) else {}
            path = tmp_path_factory.mktemp("export") / f"{backbone}.onnx"
            path.write_bytes(
                build_onnx(network, kind="x", settings=settings, sample_shape=(2, 640, COLUMNS))
            )
            made[backbone] = network, path
        return made[backbone]

    return get


def _cylinder(clouds: int, points: int, seed: int) -> np.ndarray:
    """Sub-clouds of a surface with its normals, as networks read them."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, (clouds, points))
    normal = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=2)
    height = rng.uniform(-1.5, 1.5, (clouds, points, 1)) * (0, 0, 1)
    return np.concatenate([0.7 * normal + height, normal], axis=2).astype(np.float32)


@pytest.mark.parametrize("backbone", BACKBONES)
def test_every_backbone_answers_the_same_at_sizes_it_was_not_traced_with(
    exported: Exported, backbone: str
) -> None:
    network, path = exported(backbone)
    samples = [
        _cylinder(1, 1024, 0),
        _cylinder(3, 700, 1),
        _cylinder(2, 97, 2),
        _cylinder(1, 64, 3),
    ]
    found = agreement(network, OnnxNetwork(path, "x"), samples)
    # both have the same 16-bit weights: what is left is the order of sums, which a search for
    # neighbours among features turns into other neighbours
    assert found.usual < (2e-3 if backbone == "dgcnn" else 1e-4)
    assert found.largest < (0.05 if backbone == "dgcnn" else 1e-3)
    assert found.same_label > 0.998


@pytest.mark.parametrize("backbone", BACKBONES)
def test_files_are_moved_by_their_inputs(exported: Exported, backbone: str) -> None:
    """A parity of constants would prove nothing."""
    _, path = exported(backbone)
    logits = OnnxNetwork(path, "x").run(_cylinder(2, 200, 5))
    assert np.ptp(softmax(logits), axis=(0, 1)).max() > 0.05
    assert not np.allclose(logits[0], logits[1], atol=1e-3)


def test_pointnet2_takes_its_centres_from_outside(exported: Exported) -> None:
    _, path = exported("pointnet2")
    inputs = {entry.name for entry in onnx.load(path).graph.input}
    assert inputs == {"inputs", "centres_1", "centres_2"}
    assert OnnxNetwork(path, "x").centre_counts == (512, 128)


def test_a_difference_is_found(exported: Exported) -> None:
    network, path = exported("pct-small")
    other = small_network("pct-small", inputs=COLUMNS, classes=CLASSES, seed=1)
    exact = OnnxNetwork(path, "x")
    assert largest_difference(other, exact, [_cylinder(1, 80, 0)]) > 1e-2
    poisoned = np.full((1, 80, COLUMNS), np.nan, dtype=np.float32)
    assert np.isnan(largest_difference(network, exact, [_cylinder(1, 80, 0), poisoned]))


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


def test_large_constants_take_two_bytes(exported: Exported) -> None:
    network, path = exported("pct-small")
    numbers = sum(parameter.numel() for parameter in network.parameters())
    assert path.stat().st_size < 2.5 * numbers + 20_000


def test_constants_can_keep_all_their_bits() -> None:
    torch.manual_seed(0)
    network = Pct(PctConfig(inputs=3, classes=2, channels=32, layers=1, embedding=64, neighbours=0))
    pretend_training(network, torch.randn(2, 64, 3))
    model = onnx.load_from_string(
        build_onnx(network, kind="x", settings={}, sample_shape=(2, 100, 3), half=False)
    )
    kept = {constant.name: constant for constant in model.graph.initializer}
    assert all(constant.data_type != onnx.TensorProto.FLOAT16 for constant in kept.values())
    weight = network.state_dict()["embed.1.0.weight"].numpy()
    np.testing.assert_array_equal(onnx.numpy_helper.to_array(kept["embed.1.0.weight"]), weight)


def test_the_file_tells_nothing_of_the_training_machine(exported: Exported) -> None:
    content = exported("pct-small")[1].read_bytes()
    assert b"/work" not in content
    assert b"site-packages" not in content


def test_the_temperature_is_stored_beside_the_settings(exported: Exported, tmp_path: Path) -> None:
    path = tmp_path / "copy.onnx"
    path.write_bytes(exported("pointnet2")[1].read_bytes())
    assert OnnxNetwork(path, "x").temperature == 1.0

    set_temperature(path, 1.37)

    changed = OnnxNetwork(path, "x")
    assert changed.temperature == 1.37
    assert changed.settings["centres"] == [512, 128]
    inputs = _cylinder(1, 70, 0)
    before = OnnxNetwork(exported("pointnet2")[1], "x")
    np.testing.assert_array_equal(changed.run(inputs), before.run(inputs))


def test_softmax_rows_are_probabilities() -> None:
    logits = np.array([[1e4, -1e4, 0.0], [0.0, 0.0, 0.0]], dtype=np.float32)
    rows = softmax(logits)
    np.testing.assert_allclose(rows, [[1, 0, 0], [1 / 3, 1 / 3, 1 / 3]], atol=1e-6)
