"""With the shipped networks: neither the machine nor the order of a file changes the answer."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from boltpose.locate import locate
from boltpose.prior.file import write_prior
from boltpose.registration.prepare import prepare_prior
from boltpose.results import dump_json
from boltpose.segmentation.models import load_models
from tests.support import reman18

MOTOR, VIEW = "motor_011", 1


@pytest.fixture(scope="module")
def prior(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("prior") / "known.prior.npz"
    write_prior(path, reman18.true_prior(MOTOR))
    return path


def _locate(prior: Path, threads: int, processors: set[int]) -> dict:
    folder = reman18.ROOT / MOTOR
    command = [sys.executable, "-m", "boltpose", "locate", folder / "depth" / f"{VIEW:06d}.png"]
    command += ["--prior", prior, "--camera", folder / "scene_camera.json", "--json"]
    command += ["--hand-eye", folder / "hand_eye" / f"{VIEW:06d}.yaml"]
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    finished = subprocess.run(
        command,
        env={**os.environ, **dict.fromkeys(names, str(threads))},
        preexec_fn=lambda: os.sched_setaffinity(0, processors),
        capture_output=True,
        check=True,
    )
    answer = json.loads(finished.stdout)
    answer.pop("timings_ms")
    return answer


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processors are pinned on Linux")
def test_one_and_two_threads_and_processors_give_the_same_bits(prior: Path) -> None:
    usable = sorted(os.sched_getaffinity(0))
    alone = _locate(prior, 1, set(usable[:1]))
    assert alone["status"] == "ok"
    assert _locate(prior, 2, set(usable)) == alone


def test_the_order_of_the_points_gives_the_same_bits() -> None:
    scan, _ = reman18.view(MOTOR, VIEW)
    prepared, predictor = prepare_prior(reman18.true_prior(MOTOR)), load_models().scene
    result = locate(scan, prepared, None, predictor)
    assert result.is_ok
    mixed = scan.subset(np.random.default_rng(1).permutation(len(scan)))
    assert dump_json(locate(mixed, prepared, None, predictor)) == dump_json(result)
