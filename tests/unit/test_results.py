from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from boltpose.errors import InputFileError
from boltpose.results import SCHEMA_FILE, PosesFile, json_schema, read_poses, to_file, write_poses
from boltpose.schema import Check
from tests.support import results


def test_the_file_says_what_the_result_says(tmp_path: Path) -> None:
    result = results.located(results.cube_prior())
    write_poses(tmp_path / "poses.json", result, {"registration": 123.4567})

    data = json.loads((tmp_path / "poses.json").read_text())
    assert data["schema"] == "boltpose.poses/3"
    assert (data["status"], data["reason"], data["frame"], data["unit"]) == (
        "ok", None, "base", "mm",
    )  # fmt: skip
    assert data["timings_ms"] == {"registration": 123.457}
    assert data["quality"] == dict(result.verdict.scores)
    for written, bolt in zip(data["bolts"], result.bolts, strict=True):
        assert written["id"] == bolt.id
        np.testing.assert_array_equal(written["head_top"], bolt.frame_from_bolt.translation_mm)
        np.testing.assert_array_equal(written["rotation"], bolt.frame_from_bolt.rotation)
        # the head's centre lies half a head below its top, against the axis
        step = np.subtract(written["head_top"], written["position"])
        np.testing.assert_allclose(step, np.array(written["axis"]) * bolt.head_height_mm / 2)
        assert written["confidence"] == bolt.confidence == 0.9
    assert data["rejected_candidate"] is None
    np.testing.assert_array_equal(data["base_from_camera"], results.BASE_FROM_CAMERA.matrix)
    assert read_poses(tmp_path / "poses.json") == to_file(result, {"registration": 123.4567})


def test_a_refused_file_holds_no_pose_a_robot_could_follow() -> None:
    data = to_file(results.refused(results.cube_prior()))
    assert data.bolts == []
    assert data.camera_from_prior is None
    assert data.registration is None
    assert data.rejected_candidate is not None
    assert data.reason is Check.FREE_SPACE
    assert data.reasons


def test_the_shipped_schema_is_that_of_the_code() -> None:
    assert SCHEMA_FILE.read_text() == json_schema()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"status": "refused"}, "never both"),
        ({"base_from_camera": None}, "needs base_from_camera"),
        ({"unit": "m"}, "Input should be 'mm'"),
        ({"extra": 1}, "Extra inputs"),
        ({"schema": "boltpose.poses/9"}, "boltpose.poses/3"),
    ],
)
def test_files_that_contradict_themselves_are_refused(change: dict[str, object], text: str) -> None:
    data = to_file(results.located(results.cube_prior())).model_dump(mode="json", by_alias=True)
    PosesFile.model_validate(data)
    with pytest.raises(ValidationError, match=text):
        PosesFile.model_validate(data | change)


def test_a_mirrored_turned_or_unexplained_bolt_is_refused() -> None:
    data = to_file(results.located(results.cube_prior())).model_dump(mode="json", by_alias=True)
    bolt = data["bolts"][0]
    for state, reason in (("contradicted", ""), ("confirmed", "something else")):
        changed = data | {"bolts": [bolt | {"state": state, "state_reason": reason}]}
        with pytest.raises(ValidationError, match="a contradiction, and only that"):
            PosesFile.model_validate(changed)
    for rotation, text in (
        (np.diag([1.0, 1.0, -1.0]) @ bolt["rotation"], "mirrors"),
        (2 * np.array(bolt["rotation"]), "not orthonormal"),
        (np.array(bolt["rotation"])[:, [1, 2, 0]], "not the third column"),
    ):
        changed = data | {"bolts": [bolt | {"rotation": rotation.tolist()}]}
        with pytest.raises(ValidationError, match=text):
            PosesFile.model_validate(changed)


def test_reading_names_the_file_and_the_field(tmp_path: Path) -> None:
    bad = tmp_path / "bad.json"
    for text, found in (("{", "Invalid JSON"), ("{}", "schema: Field required")):
        bad.write_text(text)
        with pytest.raises(InputFileError, match=rf"bad\.json: found .*{found}"):
            read_poses(bad)
    with pytest.raises(InputFileError, match="no such file"):
        read_poses(tmp_path / "none.json")
