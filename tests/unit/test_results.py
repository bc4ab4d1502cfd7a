from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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
    assert data["schema"] == "boltpose.poses/4"
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
        ({"schema": "boltpose.poses/9"}, "boltpose.poses/4"),
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


def test_two_bolts_of_one_id_are_refused() -> None:
    data = to_file(results.located(results.cube_prior())).model_dump(mode="json", by_alias=True)
    twice = data | {"bolts": [data["bolts"][0], *data["bolts"]]}
    with pytest.raises(ValidationError, match="two bolts have one id"):
        PosesFile.model_validate(twice)


def _leaves(node: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a JSON document whose value is no container."""
    found = []
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        found += _leaves(value) if isinstance(value, dict | list) else [(node, key)]
    return found


def _changed(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    return value + 1e-9 if isinstance(value, int | float) else f"{value}x"


def test_no_value_but_a_time_can_be_changed_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "poses.json"
    write_poses(path, results.located(results.cube_prior()), {"registration": 1.0})
    text = path.read_text()
    for row in range(len(_leaves(json.loads(text)))):
        data = json.loads(text)
        holder, key = _leaves(data)[row]
        holder[key] = _changed(holder[key])
        path.write_text(json.dumps(data))
        if holder is data["timings_ms"]:
            read_poses(path)
        else:
            with pytest.raises(InputFileError):
                read_poses(path)


def test_a_bolt_moved_shifted_or_taken_out_by_hand_is_told(tmp_path: Path) -> None:
    path = tmp_path / "poses.json"
    write_poses(path, results.located(results.cube_prior()))
    data = json.loads(path.read_text())
    bolt = data["bolts"][0]
    metres = [value / 1000 for value in bolt["head_top"]]
    for bolts in (
        [bolt | {"head_top": metres}, *data["bolts"][1:]],
        [bolt | {"visibility": "visible", "sure": True}, *data["bolts"][1:]][::-1],
        data["bolts"][1:],
        data["bolts"][::-1],
    ):
        path.write_text(json.dumps(data | {"bolts": bolts}))
        with pytest.raises(InputFileError, match="changed since boltpose wrote it, locate again"):
            read_poses(path)


def test_another_layout_and_other_times_are_no_change(tmp_path: Path) -> None:
    path = tmp_path / "poses.json"
    result = results.located(results.cube_prior())
    write_poses(path, result, {"registration": 1.0})
    written = read_poses(path)
    data = json.loads(path.read_text())
    assert data["content_sha256"] == to_file(result, {"registration": 2.0}).content_sha256
    path.write_text(json.dumps(data, sort_keys=True, indent=None))
    assert read_poses(path) == written


def test_reading_names_the_file_and_the_field(tmp_path: Path) -> None:
    bad = tmp_path / "bad.json"
    for text, found in (("{", "Invalid JSON"), ("{}", "schema: Field required")):
        bad.write_text(text)
        with pytest.raises(InputFileError, match=rf"bad\.json: found .*{found}"):
            read_poses(bad)
    with pytest.raises(InputFileError, match="no such file"):
        read_poses(tmp_path / "none.json")
