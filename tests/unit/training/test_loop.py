from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from boltpose.errors import InputFileError
from boltpose.training.checkpoint import load_checkpoint, save_checkpoint
from boltpose.training.loop import Batch, FitConfig, fit

CONFIG = FitConfig(steps=12, learning_rate=0.05, checkpoint_every=4)


def _network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(2, 8), nn.ReLU(), nn.Dropout(0.2), nn.Linear(8, 2))


def _batch(rng: np.random.Generator) -> Batch:
    inputs = torch.from_numpy(rng.normal(size=(32, 2)).astype(np.float32))
    return inputs, (inputs.sum(dim=1) > 0).long()


def _state(network: nn.Module) -> torch.Tensor:
    return torch.cat([value.flatten() for value in network.state_dict().values()])


def test_fitting_lowers_the_loss() -> None:
    losses: list[float] = []
    fit(_network(), _batch, replace(CONFIG, steps=60), on_step=lambda _, loss: losses.append(loss))
    assert np.mean(losses[-10:]) < 0.6 * np.mean(losses[:3])


def test_a_resumed_run_ends_where_an_uninterrupted_one_does(tmp_path: Path) -> None:
    whole = _network()
    fit(whole, _batch, CONFIG)

    class PowerCutError(Exception):
        pass

    def cut(step: int, loss: float) -> None:
        if step == 9:
            raise PowerCutError

    path = tmp_path / "run.safetensors"
    with pytest.raises(PowerCutError):
        fit(_network(), _batch, CONFIG, checkpoint=path, on_step=cut)
    steps: list[int] = []
    resumed = _network()
    fit(resumed, _batch, CONFIG, checkpoint=path, on_step=lambda step, _: steps.append(step))

    assert steps == [8, 9, 10, 11]
    torch.testing.assert_close(_state(resumed), _state(whole), atol=0, rtol=0)
    assert not path.exists()


def test_the_rate_rises_and_falls() -> None:
    config = FitConfig(steps=100, warmup_share=0.1, final_rate=0.01)
    rates = [config.rate(step) for step in range(100)]
    assert np.argmax(rates) in (9, 10)
    assert max(rates) == pytest.approx(1.0)
    assert (np.diff(rates[10:]) < 0).all()
    assert rates[-1] == pytest.approx(0.01, abs=0.002)


def test_a_checkpoint_of_another_network_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.safetensors"
    network = _network()
    save_checkpoint(path, network, torch.optim.AdamW(network.parameters()), 3)
    other = nn.Linear(5, 5)
    with pytest.raises(InputFileError, match="of this network"):
        load_checkpoint(path, other, torch.optim.AdamW(other.parameters()))


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.safetensors"
    path.write_bytes(b"not a checkpoint")
    network = _network()
    with pytest.raises(InputFileError, match="a checkpoint of boltpose"):
        load_checkpoint(path, network, torch.optim.AdamW(network.parameters()))


@pytest.mark.parametrize(
    ("name", "value"),
    [("steps", 0), ("learning_rate", float("nan")), ("clip_norm", 0.0), ("label_smoothing", 1.0)],
)
def test_settings_are_checked(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        FitConfig(**{"steps": 5, name: value})  # pyright: ignore[reportArgumentType]
