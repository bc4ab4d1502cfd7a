from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boltpose.datasets.reman18 import Reman18
from boltpose.errors import InputFileError

DATA = Reman18(root=Path(__file__).parents[3] / "data" / "reman18")


def test_eighteen_motors_of_six_families() -> None:
    assert len(DATA.motors) == 18
    assert len(DATA.families) == 6
    assert {len(DATA.motors_of(family)) for family in DATA.families} == {3}


def test_a_full_scan_lies_where_its_view_saw_it() -> None:
    scan, view = DATA.full_scan("motor_001"), DATA.view("motor_001", 2)
    camera_from_prior = DATA.camera_from_prior("motor_001", 2)
    moved = scan.points @ camera_from_prior[:3, :3].T + camera_from_prior[:3, 3]
    low, high = moved.min(axis=0), moved.max(axis=0)
    motor = view.points[view.labels > 0]
    assert ((motor > low - 3) & (motor < high + 3)).all(axis=1).mean() > 0.999
    assert set(np.unique(scan.labels)) == {1, 2, 3, 4, 5, 6}


def test_another_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="a reman18 folder"):
        Reman18(root=tmp_path)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(ValueError, match="family must be one of"):
        DATA.motors_of("diesel")
