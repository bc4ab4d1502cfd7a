from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

RUN = """
import numpy as np
from boltpose.segmentation.models import load_models
points = np.random.default_rng(0).normal(0.0, 30.0, (3000, 3)) + [0.0, 0.0, 700.0]
assert len(load_models().scene.predict(points)) == len(points)
"""


def test_networks_tell_nobody_what_they_are_used_for(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("ORT_", "XDG_"))}
    subprocess.run(
        [sys.executable, "-c", RUN],
        check=True,
        timeout=120,
        env=environment | {"HOME": str(tmp_path)},
    )

    # onnxruntime keeps a device id and a database of events in ~/.cache
    assert [path for path in tmp_path.rglob("*") if "onnxruntime" in path.name] == []
