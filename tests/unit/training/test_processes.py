"""Training in two processes is training in one with twice the batch."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from boltpose.errors import ConfigError
from boltpose.training.hardware import Hardware
from boltpose.training.run_log import read_log

REPOSITORY = Path(__file__).parents[3]
SCRIPT = ["-m", "tests.support.fit_in_processes"]
TORCHRUN = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]


def _run(*arguments: str) -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def _losses(folder: Path) -> list[float]:
    return [record.loss for record in read_log(folder)]


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("alone")
    _run(*SCRIPT, str(folder), "4", "1")
    return folder


@pytest.mark.parametrize(
    "start",
    [[*TORCHRUN, *SCRIPT], SCRIPT],
    ids=["torchrun", "fabric starts the second"],
)
def test_two_processes_are_one_with_the_doubled_batch(
    alone: Path, tmp_path: Path, start: list[str]
) -> None:
    _run(*start, str(tmp_path), "2", "2")
    wanted = _losses(alone)
    assert len(wanted) == 12
    assert wanted[-1] < wanted[0]
    # sums are added in another order; twelve steps do not let that grow. (Weights are not
    # compared: AdamW makes full steps of gradients that are nothing but rounding.)
    np.testing.assert_allclose(_losses(tmp_path), wanted, rtol=2e-4)


def test_hardware_that_is_not_there_is_refused() -> None:
    with pytest.raises(ConfigError, match="accelerator must be one of"):
        Hardware(accelerator="abacus")
    with pytest.raises(ConfigError, match="devices must be >= 1"):
        Hardware(devices=0)
    if not torch.cuda.is_available():
        with pytest.raises(ConfigError, match="finds no GPU"):
            Hardware(accelerator="cuda").launch()
