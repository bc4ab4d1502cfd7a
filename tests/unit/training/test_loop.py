from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from boltpose.errors import InputFileError
from boltpose.training.checkpoint import load_checkpoint, save_checkpoint
from boltpose.training.loop import Cloud, FitConfig, fit
from boltpose.training.run_log import LOG_FILE, RunLog, StepRecord, read_log

CONFIG = FitConfig(steps=12, batch=2, learning_rate=0.05, checkpoint_every=4)


def _network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(2, 8), nn.ReLU(), nn.Dropout(0.2), nn.Linear(8, 2))


def _draw(rng: np.random.Generator) -> Cloud:
    inputs = rng.normal(size=(16, 2)).astype(np.float32)
    return inputs, (inputs.sum(axis=1) > 0).astype(np.int64)


def _state(network: nn.Module) -> torch.Tensor:
    return torch.cat([value.flatten() for value in network.state_dict().values()])


def test_fitting_lowers_the_loss() -> None:
    losses: list[float] = []
    fit(_network(), _draw, replace(CONFIG, steps=60), on_step=lambda _, loss: losses.append(loss))
    assert np.mean(losses[-10:]) < 0.6 * np.mean(losses[:3])


class PowerCutError(Exception):
    pass


def test_a_resumed_run_ends_where_an_uninterrupted_one_does(tmp_path: Path) -> None:
    whole = _network()
    fit(whole, _draw, CONFIG, log=tmp_path / "whole")

    def cut(step: int, loss: float) -> None:
        if step == 9:
            raise PowerCutError

    path = tmp_path / "run.safetensors"
    log = tmp_path / "resumed"
    with pytest.raises(PowerCutError):
        fit(_network(), _draw, CONFIG, checkpoint=path, log=log, on_step=cut)
    steps: list[int] = []
    resumed = _network()
    fit(
        resumed,
        _draw,
        CONFIG,
        checkpoint=path,
        log=log,
        on_step=lambda step, _: steps.append(step),
    )

    assert steps == [8, 9, 10, 11]
    torch.testing.assert_close(_state(resumed), _state(whole), atol=0, rtol=0)
    assert not path.exists()
    # the log too, although the steps after the checkpoint were written twice
    assert read_log(log) == read_log(tmp_path / "whole")
    assert [record.step for record in read_log(log)] == list(range(12))


def test_denormals_are_numbers_again_afterwards() -> None:
    """It is a state of the thread: what runs next, and k-d trees above all, counts on them."""
    tiny = np.float64(5e-324)
    during: list[bool] = []

    def draw(rng: np.random.Generator) -> Cloud:
        during.append(bool(tiny * np.float64(1.0) == 0))
        return _draw(rng)

    fit(_network(), draw, replace(CONFIG, steps=1))
    assert all(during)
    assert tiny * np.float64(1.0) > 0

    def fail(rng: np.random.Generator) -> Cloud:
        raise PowerCutError

    with pytest.raises(PowerCutError):
        fit(_network(), fail, CONFIG)
    assert tiny * np.float64(1.0) > 0


def test_a_log_cut_short_in_a_line_is_read_up_to_there(tmp_path: Path) -> None:
    log = RunLog(tmp_path)
    for step in range(3):
        log.add(StepRecord(step=step, loss=1.0 / (step + 1), rate=0.1))
    log.close()
    path = tmp_path / LOG_FILE
    path.write_text(path.read_text()[:-9])
    assert [record.step for record in read_log(tmp_path)] == [0, 1]
    assert json.loads(path.read_text().splitlines()[0]) == {"step": 0, "loss": 1.0, "rate": 0.1}


def test_every_sub_cloud_has_its_own_generator() -> None:
    """So the clouds of a step are the same, whoever draws which of them."""
    seen: list[float] = []

    def draw(rng: np.random.Generator) -> Cloud:
        seen.append(float(rng.random()))
        return _draw(rng)

    fit(_network(), draw, replace(CONFIG, steps=2, batch=3))
    wanted = [
        float(np.random.default_rng([0, step, number]).random())
        for step in range(2)
        for number in range(3)
    ]
    assert seen == wanted


def test_a_penalty_is_added_to_the_loss() -> None:
    class Held(nn.Module):
        """Cannot learn, but for the penalty that pulls its weight to zero."""

        def __init__(self) -> None:
            super().__init__()
            self.weight = nn.Parameter(torch.ones(1))

        def forward(self, inputs: torch.Tensor) -> torch.Tensor:
            return torch.zeros(*inputs.shape[:2], 2) + 0 * self.weight

        def penalty(self) -> torch.Tensor:
            return self.weight.square().sum()

    network = Held()
    fit(network, _draw, replace(CONFIG, steps=30, weight_decay=0.0))
    assert abs(float(network.weight.detach())) < 0.5


def test_the_rate_rises_and_falls() -> None:
    config = FitConfig(steps=100, warmup_share=0.1, final_rate=0.01)
    rates = [config.rate(step) for step in range(100)]
    assert np.argmax(rates) in (9, 10)
    assert max(rates) == pytest.approx(1.0)
    assert (np.diff(rates[10:]) < 0).all()
    assert rates[-1] == pytest.approx(0.01, abs=0.002)
    assert replace(config, warmup_share=0.0).rate(0) == 1.0


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
