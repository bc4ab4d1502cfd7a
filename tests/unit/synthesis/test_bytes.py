from __future__ import annotations

from functools import partial
from pathlib import Path

from boltpose.synthesis.run import run_data_set, run_local
from boltpose.synthesis.scene_sample import make_scene_sample
from tests.unit.synthesis.conftest import SMALL
from tests.unit.synthesis.test_run import tree_bytes


def test_a_worker_process_makes_the_same_bytes_as_this_one(scenes: Path, tmp_path: Path) -> None:
    run_data_set(tmp_path, SMALL, 1, make_scene_sample, partial(run_local, workers=2))
    made, expected = tree_bytes(tmp_path), tree_bytes(scenes)
    names = {name for name in expected if name.startswith("motor_")}
    assert len(names) == 13
    assert {name for name in made if name.startswith("motor_")} == names
    assert {name for name in names if made[name] != expected[name]} == set()
