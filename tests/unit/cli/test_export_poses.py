from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.export_poses import Target
from boltpose.geometry.transforms import Transform
from boltpose.results import write_poses
from boltpose.robot import RobotFormat
from boltpose.schema import BoltState, LocateResult, Visibility
from tests.support import results
from tests.support.robot_files import READERS
from tests.unit.cli.conftest import Run, write_matrix

NAMES = {
    Target.URSCRIPT: "bolts.script",
    Target.KUKA: "bolts.dat",
    Target.FANUC: "bolts.ls",
    Target.ABB: "bolts.mod",
    Target.ROS2_MCAP: "bolts.mcap",
    Target.CSV: "bolts.csv",
}
BOP = ("--scene", "3", "--image", "2", "--object", "1")


def poses_file(folder: Path, result: LocateResult) -> Path:
    path = folder / "poses.json"
    write_poses(path, result, {"segmentation": 250.0, "registration": 500.0})
    return path


@pytest.fixture
def accepted(tmp_path: Path) -> Path:
    result = results.located(results.cube_prior())
    sure = [replace(bolt, is_sure=True) for bolt in result.bolts[:2]]
    return poses_file(tmp_path, replace(result, bolts=(*sure, *result.bolts[2:])))


def test_the_command_knows_every_format() -> None:
    assert {one.value for one in RobotFormat} | {"bop-csv"} == {one.value for one in Target}


@pytest.mark.parametrize("to", [one for one in Target if one.value in READERS])
def test_a_robots_file(run: Run, accepted: Path, tmp_path: Path, to: Target) -> None:
    target = tmp_path / NAMES[to]
    outcome = run("export-poses", accepted, "--to", to.value, "-o", target, "--approach", "70")

    assert outcome.code == ExitCode.OK
    read = READERS[to.value](target.read_bytes())
    heads = [
        results.BASE_FROM_CAMERA.apply(results.CAMERA_FROM_PRIOR.apply(point))
        for point in ([20.0, 20.0, 50.0], [-20.0, -20.0, 50.0])
    ]
    for approach, contact, head in zip(
        read.poses["approach"], read.poses["contact"], heads, strict=True
    ):
        np.testing.assert_allclose(contact[:3, 3], head, atol=0.001)
        np.testing.assert_allclose(approach[:3, 3] - contact[:3, 3], [0, 0, 70], atol=0.001)
    assert "B1  left out: hidden from the camera" in outcome.out
    assert f"wrote {target}" in outcome.err


def test_ros(run: Run, accepted: Path, tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2", reason="needs the extra ros2")
    target = tmp_path / "bolts.mcap"
    outcome = run("export-poses", accepted, "--to", "ros2-mcap", "-o", target, "--stamp", "5")
    assert outcome.code == ExitCode.OK
    assert target.read_bytes().startswith(b"\x89MCAP0\r\n")


def test_json_says_what_was_written(run: Run, accepted: Path, tmp_path: Path) -> None:
    target = tmp_path / "bolts.csv"
    outcome = run(
        "export-poses", accepted, "--to", "csv", "-o", target, "--json", "--include-hidden",
        "--include-unsure",
    )  # fmt: skip
    said = json.loads(outcome.out)
    assert said["written"] == str(target)
    assert said["frame"] == "base_from_tool"
    assert [bolt["id"] for bolt in said["bolts"]] == ["T1", "T2", "B1"]
    assert said["left_out"] == []
    assert [text.split(":")[0] for text in said["warnings"]] == ["B1", "B1"]
    # the warnings are for a person too, whatever stdout carries
    assert "B1: hidden" in outcome.err


@pytest.mark.parametrize("to", list(Target))
def test_a_refused_result_gives_no_file_and_removes_an_old_one(
    run: Run, tmp_path: Path, to: Target
) -> None:
    poses = poses_file(tmp_path, results.refused(results.cube_prior()))
    target = tmp_path / NAMES.get(to, "bop.csv")
    target.write_text("poses of an older scan")

    outcome = run("export-poses", poses, "--to", to.value, "-o", target, *BOP)

    assert outcome.code == ExitCode.REFUSED
    assert not target.exists()
    assert "free_space_violation 0.06" in outcome.err
    assert outcome.err.count("\n") == 1
    assert outcome.out == ""


def test_a_refusal_as_json(run: Run, tmp_path: Path) -> None:
    poses = poses_file(tmp_path, results.refused(results.cube_prior()))
    outcome = run("export-poses", poses, "--to", "abb", "-o", tmp_path / "b.mod", "--json")
    assert outcome.code == ExitCode.REFUSED
    said = json.loads(outcome.out)
    assert said["written"] is None
    assert "refused" in said["reason"]


@pytest.mark.parametrize("to", [one for one in Target if one is not Target.BOP_CSV])
def test_frame_camera_gives_no_file(run: Run, tmp_path: Path, to: Target) -> None:
    poses = poses_file(tmp_path, results.located(results.cube_prior(), None))
    target = tmp_path / NAMES[to]
    target.write_text("old")
    outcome = run("export-poses", poses, "--to", to.value, "-o", target)
    assert outcome.code == ExitCode.BAD_INPUT
    assert "--hand-eye" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not target.exists()


def test_bop_wants_the_camera_and_its_own_numbers(run: Run, tmp_path: Path) -> None:
    poses = poses_file(tmp_path, results.located(results.cube_prior(), None))
    target = tmp_path / "bop.csv"
    outcome = run("export-poses", poses, "--to", "bop-csv", "-o", target)
    assert outcome.code == ExitCode.BAD_INPUT
    assert "--scene, --image and --object" in outcome.err

    outcome = run("export-poses", poses, "--to", "bop-csv", "-o", target, *BOP)
    assert outcome.code == ExitCode.OK
    row = target.read_text().splitlines()[1].split(",")
    assert row[:3] == ["3", "2", "1"]
    assert row[5] == "0.0 0.0 700.0"
    assert row[6] == "0.75"


def test_bop_with_the_model_elsewhere(run: Run, accepted: Path, tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    write_matrix(model, Transform.from_parts("prior", "motor", np.eye(3), (10, 0, 0)).matrix)
    target = tmp_path / "bop.csv"
    outcome = run(
        "export-poses", accepted, "--to", "bop-csv", "-o", target, *BOP, "--model-pose", model
    )
    assert outcome.code == ExitCode.OK
    assert target.read_text().splitlines()[1].split(",")[5] == "10.0 0.0 700.0"


def test_a_contradicted_bolt_needs_to_be_asked_for(run: Run, tmp_path: Path) -> None:
    result = results.located(results.cube_prior())
    wrong = replace(result.bolts[0], state=BoltState.CONTRADICTED, state_reason="a hole")
    poses = poses_file(tmp_path, replace(result, bolts=(wrong,)))
    target = tmp_path / "bolts.dat"

    outcome = run("export-poses", poses, "--to", "kuka", "-o", target)
    assert outcome.code == ExitCode.REFUSED
    assert "T1: contradicted by the camera (a hole)" in outcome.err
    assert not target.exists()

    outcome = run("export-poses", poses, "--to", "kuka", "-o", target, "--include-contradicted")
    assert outcome.code == ExitCode.OK
    assert "no tool must go there" in outcome.err
    assert "WARNING" in READERS["kuka"](target.read_bytes()).comments[0]


def test_all_hidden_is_a_refusal(run: Run, tmp_path: Path) -> None:
    result = results.located(results.cube_prior())
    hidden = tuple(replace(bolt, visibility=Visibility.HIDDEN) for bolt in result.bolts)
    poses = poses_file(tmp_path, replace(result, bolts=hidden))
    outcome = run("export-poses", poses, "--to", "csv", "-o", tmp_path / "b.csv")
    assert outcome.code == ExitCode.REFUSED
    assert "--include-hidden" in outcome.err


def test_an_old_result_can_be_refused(run: Run, accepted: Path, tmp_path: Path) -> None:
    target = tmp_path / "bolts.csv"
    arguments = ("export-poses", accepted, "--to", "csv", "-o", target, "--max-age", "60")
    assert run(*arguments).code == ExitCode.OK
    long_ago = time.time() - 3600
    os.utime(accepted, (long_ago, long_ago))
    outcome = run(*arguments)
    assert outcome.code == ExitCode.REFUSED
    assert "scan again" in outcome.err
    assert not target.exists()
    # a clock that went back proves nothing either
    os.utime(accepted, (time.time() + 3600,) * 2)
    assert run(*arguments).code == ExitCode.REFUSED
    assert run(*arguments[:-1], "0").code == ExitCode.BAD_INPUT


def test_the_tcp_is_taken_off(run: Run, accepted: Path, tmp_path: Path) -> None:
    tcp = tmp_path / "tcp.yaml"
    write_matrix(tcp, Transform.from_parts("flange", "tool", np.eye(3), (0, 0, 180)).matrix)
    plain, moved = tmp_path / "plain.csv", tmp_path / "moved.csv"
    assert run("export-poses", accepted, "--to", "csv", "-o", plain).code == ExitCode.OK
    outcome = run("export-poses", accepted, "--to", "csv", "-o", moved, "--tcp", tcp)
    assert outcome.code == ExitCode.OK
    assert "base_from_flange" in moved.read_text()
    first, second = (READERS["csv"](path.read_bytes()).poses["contact"] for path in (plain, moved))
    for tip, flange in zip(first, second, strict=True):
        # the tool looks down: the flange is 180 mm above its tip
        np.testing.assert_allclose(flange[:3, 3] - tip[:3, 3], [0, 0, 180], atol=0.001)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--to", "kuka", "-o", "{}/bolts.src"), "wanted .dat"),
        (("--to", "kuka", "-o", "{}/my bolts.dat"), "the name 'my bolts'"),
        (("--to", "kuka", "-o", "{}/nowhere/bolts.dat"), "an existing folder"),
        (("--to", "yaskawa", "-o", "{}/bolts.dat"), "yaskawa"),
        (("--to", "csv", "-o", "{}/b.csv", "--approach", "-5"), "approach_mm must be"),
        (("--to", "csv", "-o", "{}/b.csv", "--tool-x", "up"), "tool_x must be"),
        (("--to", "csv", "-o", "{}/b.csv", "--order", "random"), "order must be"),
        (("--to", "csv", "-o", "{}/b.csv", "--min-tool-fits", "0.5"), "--tool-tolerance"),
        (("--to", "csv", "-o", "{}/b.csv", "--tcp", "{}/none.yaml"), "none.yaml"),
        (("--to", "ros2-mcap", "-o", "{}/b.mcap", "--stamp", "-1"), "stamp"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    run: Run, accepted: Path, tmp_path: Path, arguments, said: str
) -> None:
    outcome = run("export-poses", accepted, *(text.format(tmp_path) for text in arguments))
    assert outcome.code == ExitCode.BAD_INPUT
    assert said in outcome.err
    assert outcome.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["poses.json"]


def test_the_input_is_never_the_output(run: Run, tmp_path: Path) -> None:
    poses = poses_file(tmp_path, results.located(results.cube_prior())).rename(tmp_path / "p.csv")
    outcome = run("export-poses", poses, "--to", "csv", "-o", poses)
    assert outcome.code == ExitCode.BAD_INPUT
    assert poses.exists()
