"""Plain networks on sub-clouds, trained for seconds on toy motors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from boltpose.errors import ConfigError, InputFileError
from boltpose.training.plain import (
    PlainConfig,
    draw_sub_cloud,
    load_plain,
    score_plain,
    train_plain,
)
from boltpose.training.run_log import read_log
from boltpose.training.sub_clouds import (
    CloudVariation,
    LabelledInputs,
    full_inputs,
    load_pool,
)
from tests.support.toy_data_set import ToyDataSet

DATA = ToyDataSet()
CONFIG = PlainConfig(
    backbone="pct-small",
    points=128,
    batch=2,
    epochs=1.0,
    points_per_epoch=1024,
    warm_up_epochs=0.1,
    learning_rate=3e-3,
    use_bfloat16=False,
    checkpoint_every=3,
)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("features")


def _weights(path: Path) -> torch.Tensor:
    network, _ = load_plain(path)
    return torch.cat([value.double().flatten() for value in network.state_dict().values()])


def test_a_network_learns_one_motor_by_heart(cache: Path, tmp_path: Path) -> None:
    config = replace(CONFIG, inputs="normals", epochs=40.0, points=256)
    weights = train_plain(DATA, ("toy_0",), config, tmp_path / "run", cache=cache)
    confusion = score_plain(DATA, ("toy_0",), weights, cache=cache)
    assert confusion.sum() == len(DATA.full_scan("toy_0").labels)
    assert np.diag(confusion).sum() / confusion.sum() > 0.9
    losses = [record.loss for record in read_log(tmp_path / "run")]
    assert len(losses) == config.steps(1)
    assert any((tmp_path / "run" / "tensorboard").iterdir())


def test_a_killed_run_ends_with_the_same_weights(cache: Path, tmp_path: Path) -> None:
    motors = ("toy_0", "toy_1")
    whole = train_plain(DATA, motors, CONFIG, tmp_path / "whole", cache=cache)

    class KilledError(Exception):
        pass

    def kill(what: str, step: int, steps: int, loss: float) -> None:
        if what == "training" and step == 4:
            raise KilledError

    with pytest.raises(KilledError):
        train_plain(DATA, motors, CONFIG, tmp_path / "again", cache=cache, on_progress=kill)
    assert not (tmp_path / "again" / "weights.safetensors").exists()
    steps: list[int] = []
    again = train_plain(
        DATA,
        motors,
        CONFIG,
        tmp_path / "again",
        cache=cache,
        on_progress=lambda what, step, *_: steps.append(step) if what == "training" else None,
    )

    assert steps[0] == 3
    assert torch.equal(_weights(again), _weights(whole))
    # a finished run is not touched
    before = again.stat().st_mtime_ns
    train_plain(DATA, motors, CONFIG, tmp_path / "again", cache=cache)
    assert again.stat().st_mtime_ns == before


def test_a_run_starts_from_pretrained_weights(cache: Path, tmp_path: Path) -> None:
    first = train_plain(DATA, ("toy_0",), CONFIG, tmp_path / "first", cache=cache)
    almost_still = replace(CONFIG, learning_rate=1e-12)
    second = train_plain(
        DATA, ("toy_1",), almost_still, tmp_path / "second", cache=cache, pretrained=first.parent
    )
    one, other = load_plain(first)[0], load_plain(second)[0]
    for name, value in one.named_parameters():
        torch.testing.assert_close(value, dict(other.named_parameters())[name], atol=1e-8, rtol=0)
    assert torch.equal(one.mean, other.mean)


def test_weights_of_another_network_are_refused(cache: Path, tmp_path: Path) -> None:
    first = train_plain(DATA, ("toy_0",), CONFIG, tmp_path / "first", cache=cache)
    other = replace(CONFIG, inputs="normals")
    with pytest.raises(
        InputFileError, match=r"weights\.safetensors: found .* of \(64, 3, 1\), wanted .*6"
    ):
        train_plain(DATA, ("toy_0",), other, tmp_path / "other", cache=cache, pretrained=first)
    with pytest.raises(InputFileError, match="found no file, wanted weights"):
        train_plain(
            DATA, ("toy_0",), CONFIG, tmp_path / "third", cache=cache, pretrained=tmp_path / "none"
        )


def test_a_folder_of_another_run_is_refused(cache: Path, tmp_path: Path) -> None:
    train_plain(DATA, ("toy_0",), CONFIG, tmp_path, cache=cache)
    with pytest.raises(ConfigError, match="points was 128, now 64: choose another --out"):
        train_plain(DATA, ("toy_0",), replace(CONFIG, points=64), tmp_path, cache=cache)


def test_a_run_says_what_it_was_made_with(cache: Path, tmp_path: Path) -> None:
    train_plain(DATA, ("toy_1",), CONFIG, tmp_path, cache=cache)
    described = json.loads((tmp_path / "config.json").read_text())
    assert described["motors"] == ["toy_1"]
    assert described["backbone"] == "pct-small"
    assert load_plain(tmp_path)[1] == CONFIG


@pytest.mark.parametrize(
    ("points", "epochs", "wanted"), [(2048, 10.0, 160), (4096, 10.0, 80), (4096, 20.0, 160)]
)
def test_larger_sub_clouds_make_fewer_steps(points: int, epochs: float, wanted: int) -> None:
    """As in the paper: 4096 points with doubled epochs make as many steps as 2048."""
    config = PlainConfig(points=points, epochs=epochs, batch=4, points_per_epoch=8192)
    assert config.steps(16) == wanted
    assert config.steps(16, processes=2) == wanted // 2


def test_a_sub_cloud_keeps_its_classes_and_its_shape(cache: Path) -> None:
    pool = load_pool(DATA, ("toy_0",), CONFIG.pool_config(), cache)
    inputs, classes = draw_sub_cloud(pool, CONFIG, np.random.default_rng(0))
    again, _ = draw_sub_cloud(pool, CONFIG, np.random.default_rng(0))
    assert inputs.shape == (128, 3)
    assert inputs.dtype == np.float32
    np.testing.assert_array_equal(inputs, again)
    assert set(np.unique(classes)) <= set(range(6))


def test_variation_moves_rigidly_but_for_scale_and_mirror() -> None:
    rng = np.random.default_rng(0)
    cloud = np.concatenate([rng.normal(size=(50, 3)), np.tile([0.0, 0.6, 0.8], (50, 1))], axis=1)
    variation = CloudVariation(turn_rad=1.0, tilt_rad=0.5, jitter=0.0)
    varied = variation.apply(cloud.astype(np.float32), rng)
    before = np.linalg.norm(cloud[:, None, :3] - cloud[None, :, :3], axis=2)
    after = np.linalg.norm(varied[:, None, :3] - varied[None, :, :3], axis=2)
    ratio = after[before > 0.1] / before[before > 0.1]
    assert ratio.max() - ratio.min() < 1e-4
    assert 0.9 <= ratio.mean() <= 1.1
    np.testing.assert_allclose(np.linalg.norm(varied[:, 3:], axis=1), 1.0, atol=1e-5)
    # normals turn with the points: their angle to a chord does not change
    chord = (varied[0, :3] - varied[1, :3]) @ varied[0, 3:] / ratio.mean()
    assert chord == pytest.approx((cloud[0, :3] - cloud[1, :3]) @ cloud[0, 3:], abs=1e-4)


def test_features_come_with_place_and_normal_first(cache: Path) -> None:
    plain: dict[str, tuple[LabelledInputs, ...]] = {
        kind: full_inputs(DATA, ("toy_0",), replace(CONFIG, inputs=kind).pool_config(), cache)
        for kind in ("xyz", "normals", "features")
    }
    wide = plain["features"][0].inputs
    np.testing.assert_array_equal(wide[:, :6], plain["normals"][0].inputs)
    np.testing.assert_array_equal(wide[:, :3], plain["xyz"][0].inputs)
    assert wide.shape[1] == 83
    np.testing.assert_allclose(np.linalg.norm(wide[:, 3:6], axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("task", "cats"),
        ("inputs", "colours"),
        ("backbone", "resnet"),
        ("points", 0),
        ("epochs", 0.0),
        ("warm_up_epochs", 99.0),
        ("learning_rate", float("nan")),
    ],
)
def test_settings_are_checked(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=name):
        PlainConfig(**{name: value})  # pyright: ignore[reportArgumentType]
