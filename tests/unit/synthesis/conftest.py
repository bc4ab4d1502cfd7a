"""One small data set of scenes, made once for all tests that look at its files."""

from __future__ import annotations

from pathlib import Path

import pytest

from boltpose.synthesis.run import run_data_set, run_local
from boltpose.synthesis.scene_sample import make_scene_sample
from boltpose.synthesis.settings import DataSetSettings, Kind

SMALL = DataSetSettings(
    kind=Kind.SCENES,
    seed=5,
    families=("motorcycle",),
    views=2,
    clamps=("v_blocks", "parallel_vice"),
    width_px=612,
    height_px=512,
)


@pytest.fixture(scope="session")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One motor of a small family, two views of a quarter of the pixels."""
    root = tmp_path_factory.mktemp("scenes")
    run_data_set(root, SMALL, 1, make_scene_sample, run_local)
    return root
