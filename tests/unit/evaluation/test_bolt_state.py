from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boltpose.errors import InputFileError
from boltpose.evaluation.bolt_state import FOLDER, read_set
from boltpose.evaluation.bolt_state_cases import misplace
from boltpose.evaluation.bolt_state_report import sections
from boltpose.geometry.transforms import Transform, angle_between_rad


def bolt(fate: str, state: str, **kwargs: Any) -> dict[str, Any]:
    return {
        "bolt_id": "T1",
        "fate": fate,
        "state": state,
        "visible_before": 0.5,
        "visible_after": 0.5,
        "higher_mm": 0.0,
        "wider_mm": 0.0,
    } | kwargs


def write(results: Path, name: str, bolts: list[dict[str, Any]], **kwargs: Any) -> None:
    (results / FOLDER).mkdir(exist_ok=True)
    view = {"name": "motor_00000/0", "bolts": bolts, "found": [], "surplus": []} | kwargs
    document = {"source": "0", "motors": {"motor_00000": [view]}}
    (results / FOLDER / f"{name}.json").write_text(json.dumps(document))


def test_nothing_measured_makes_no_section(tmp_path: Path) -> None:
    assert sections(tmp_path) == []
    assert read_set(tmp_path, "changed") is None


def test_bolts_are_counted_by_fate_state_and_what_was_visible(tmp_path: Path) -> None:
    hidden = {"visible_before": 0.0, "visible_after": 0.1}
    write(
        tmp_path,
        "changed_test",
        [
            bolt("kept", "confirmed"),
            bolt("kept", "confirmed"),
            bolt("kept", "contradicted"),
            bolt("kept", "unseen", **hidden),
            bolt("lost", "contradicted", visible_after=0.0),
            bolt("lost", "unseen", visible_after=0.0),
            bolt("lost", "unseen", **hidden),
            bolt("replaced", "contradicted", higher_mm=-2.0),
            bolt("replaced", "confirmed", higher_mm=0.2, wider_mm=0.1),
            bolt("false", "unseen", **hidden),
        ],
        surplus=[{"visible_fraction": 0.6, "is_found": True}],
        found=[{"is_true": True}],
    )

    text = "\n\n".join(sections(tmp_path))

    assert "| 2 of 3 | 1 of 3 | 1 of 4 | 1 of 2 | 1 of 1 | 0 of 1 |" in text
    assert "| from 1.5 | 1 of 1 | - |" in text
    assert "1 reported, 1 of them bolts" in text
    assert "simulated" in text.splitlines()[0]


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / "factory.json").write_text("{")

    with pytest.raises(InputFileError, match="factory"):
        sections(tmp_path)


def test_a_misplaced_pose_is_off_like_a_good_registration() -> None:
    truth = Transform.from_parts("camera", "prior", np.eye(3), (30.0, -20.0, 700.0))
    centre = np.array([5.0, 1.0, 2.0])

    for seed in range(20):
        off = misplace(truth, centre, np.random.default_rng(seed))
        shift = off.apply(centre) - truth.apply(centre)
        ray = truth.apply(centre) / np.linalg.norm(truth.apply(centre))
        assert 0.1 <= abs(shift @ ray) <= 0.2
        assert np.linalg.norm(shift) < 0.35
        assert max(angle_between_rad(off.rotation[:, k], np.eye(3)[:, k]) for k in range(3)) < 0.002
    first, again = (misplace(truth, centre, np.random.default_rng(7)) for _ in range(2))
    assert np.array_equal(again.matrix, first.matrix)
