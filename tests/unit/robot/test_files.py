"""What a controller would read gives the pose back; readers are in `tests.support.robot_files`."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import spatialmath as sm
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, InputFileError
from boltpose.geometry.transforms import Transform
from boltpose.robot import RobotConfig, RobotFormat, plan_tools, robot_file, write_robot_file
from boltpose.robot.head import plain_text, scan_id
from boltpose.schema import BoltState, Visibility
from tests.support.robot_files import POINTS, READERS, read_fanuc, read_table
from tests.unit.robot.bolts import SCAN_SHA256, bolt, of_axes, result
from tests.unit.robot.test_angles import CUBE, turned

FORMATS = sorted(READERS)
ROBOTS = [name for name in FORMATS if name != "csv"]
# what each file's head promises: half a unit of the last decimal, in three components
MOST_MM = {"urscript": 0.00087, "kuka": 0.00087, "fanuc": 0.00087, "abb": 0.00087, "csv": 0.000087}
MOST_DEG = {"urscript": 5e-5, "kuka": 1.5e-4, "fanuc": 1.5e-3, "abb": 2e-6, "csv": 2e-6}


def random_axes(count: int, seed: int = 11):
    return np.random.default_rng(seed).normal(size=(count, 3))


def near_the_base_axes():
    rng = np.random.default_rng(5)
    axes = list(np.vstack([np.eye(3), -np.eye(3)]))
    return axes + [a + size * rng.normal(size=3) for a in axes for size in (1e-9, 1e-7, 1e-5, 1e-2)]


TCP = Transform.from_parts(
    "flange", "tool", Rotation.from_euler("zyx", (25, 90, -40), degrees=True).as_matrix(),
    (3.0, -70.0, 215.0),
)  # fmt: skip


def check_round_trip(plan, name: str) -> None:
    read = READERS[name](robot_file(plan, RobotFormat(name)))
    for point in POINTS:
        assert len(read.poses[point]) == len(plan.poses)
        for pose, found in zip(plan.poses, read.poses[point], strict=True):
            wanted = getattr(pose, point)
            off_mm = np.linalg.norm(found[:3, 3] - wanted.translation_mm)
            off_deg = math.degrees(turned(wanted.rotation, found[:3, :3]))
            assert off_mm <= MOST_MM[name] * 1.001
            # 1e-5 deg is what the gimbal lock may cost
            assert off_deg <= MOST_DEG[name] + 1e-5


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("tool_x", ["+x", "-y", "outward"])
def test_random_poses_come_back(name: str, tool_x: str) -> None:
    plan = plan_tools(of_axes(random_axes(60)), RobotConfig(tool_x=tool_x, contact_offset_mm=-4.0))
    check_round_trip(plan, name)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("tool_x", ["+x", "-x", "+y", "+z", "inward", "1,1,0"])
def test_bolts_along_the_axes_of_the_base_come_back(name: str, tool_x: str) -> None:
    check_round_trip(plan_tools(of_axes(near_the_base_axes()), RobotConfig(tool_x=tool_x)), name)


@pytest.mark.parametrize("name", FORMATS)
def test_flange_poses_come_back(name: str) -> None:
    plan = plan_tools(of_axes(near_the_base_axes()), flange_from_tool=TCP)
    check_round_trip(plan, name)


@pytest.mark.parametrize("name", FORMATS)
def test_what_is_read_takes_the_tool_onto_the_bolt(name: str) -> None:
    # not by way of the plan: from the bolt's own axis and head
    scene = of_axes(random_axes(20, seed=2))
    read = READERS[name](robot_file(plan_tools(scene), RobotFormat(name)))
    heads = np.array([one.head_top for one in scene.bolts])
    for approach, contact in zip(read.poses["approach"], read.poses["contact"], strict=True):
        one = scene.bolts[int(np.argmin(np.linalg.norm(heads - contact[:3, 3], axis=1)))]
        assert np.linalg.norm(contact[:3, 3] - one.head_top) < 0.001
        assert contact[:3, 2] @ one.axis < -1 + 1e-9
        step = contact[:3, 3] - approach[:3, 3]
        assert np.linalg.norm(step) == pytest.approx(50.0, abs=0.002)
        assert step @ contact[:3, 2] == pytest.approx(50.0, abs=0.002)  # straight in along tool z


@pytest.mark.parametrize("rotation", CUBE)
def test_numbers_mean_the_same_to_spatialmath(rotation) -> None:
    one = bolt(axis=-rotation[:, 2], at=(600, 100, 300))
    tool_x = ",".join(str(value) for value in rotation[:, 0])
    plan = plan_tools(result(one), RobotConfig(tool_x=tool_x))
    assert turned(rotation, plan.poses[0].contact.rotation) < 1e-9

    raw = READERS["urscript"](robot_file(plan, RobotFormat.URSCRIPT)).raw[1]
    assert turned(rotation, sm.SO3.EulerVec(raw[3:]).A) < 2e-6
    assert raw[:3] == pytest.approx((0.6, 0.1, 0.3), abs=1e-6)  # metres

    raw = READERS["kuka"](robot_file(plan, RobotFormat.KUKA)).raw[1]
    a, b, c = raw[3:]
    spun = sm.SO3.Rz(a, unit="deg") * sm.SO3.Ry(b, unit="deg") * sm.SO3.Rx(c, unit="deg")
    assert turned(rotation, spun.A) < 1e-5
    assert turned(rotation, sm.SO3.RPY(c, b, a, unit="deg", order="zyx").A) < 1e-5

    raw = READERS["abb"](robot_file(plan, RobotFormat.ABB)).raw[1]
    assert turned(rotation, sm.UnitQuaternion(raw[3:]).SO3().A) < 1e-7


@pytest.mark.parametrize("name", ROBOTS)
def test_the_head_says_what_an_auditor_asks(name: str) -> None:
    scene = result(
        bolt("T1", name="solenoid upper", tool="hex 8", order=1, p_tool_fits=0.912),
        bolt("T2", visibility=Visibility.HIDDEN),
    )
    plan = plan_tools(scene, RobotConfig(approach_mm=35.0, contact_offset_mm=-5.0))
    read = READERS[name](robot_file(plan, RobotFormat(name)))
    # the hash is cut where a line of the language is too short for it
    assert SCAN_SHA256 in read.head.replace(" ", "")
    for wanted in (
        "status: ok",
        "p_correct: 0.9870",
        "prior cube",
        "boltpose 9.9",
        "Frame: base",
        "scan id: 0123456789ab",
        "Follow these poses only while the motor is clamped",
        "5 mm below the top of the head",
        "35 mm out along",
        "base_from_tool",
        "z into the bolt",
        "turns of the prior first",
        "T1 'solenoid upper', tool hex 8",
        "0.912",
        "left out T2: hidden from the camera",
        " mm",
        "Rounded to",
        "moves the robot",
    ):
        assert wanted in read.head, wanted
    assert "WARNING" not in read.head
    assert read.scan_id == "0123456789ab"


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("urscript", "radians"),
        ("kuka", "Rz(A) Ry(B) Rx(C)"),
        ("fanuc", "Rz(R) Ry(P) Rx(W)"),
        ("abb", "[w, x, y, z]"),
    ],
)
def test_the_head_says_what_the_angles_are(name: str, unit: str) -> None:
    assert unit in READERS[name](robot_file(plan_tools(result(bolt())), RobotFormat(name))).head


@pytest.mark.parametrize("name", ROBOTS)
def test_a_bolt_against_advice_is_warned_of_before_anything_else(name: str) -> None:
    scene = result(bolt("T1"), bolt("T2", state=BoltState.CONTRADICTED, state_reason="a hole"))
    plan = plan_tools(scene, RobotConfig(include_contradicted=True))
    read = READERS[name](robot_file(plan, RobotFormat(name)))
    assert "WARNING" in read.comments[0]
    said = "T2: CONTRADICTED by the camera (a hole): no tool must go there"
    assert read.head.index(said) < read.head.index("END OF WARNING") < read.head.index("status")


def test_the_table_warns_in_its_row() -> None:
    scene = result(bolt("T1"), bolt("T2", visibility=Visibility.HIDDEN))
    text = robot_file(plan_tools(scene, RobotConfig(include_hidden=True)), RobotFormat.CSV).decode()
    assert "hidden: the camera did not see it" in text.splitlines()[2]
    assert "hidden: the" not in text.splitlines()[1]


HOSTILE = [
    "Größe Ölablaß",
    "x\nMOVE; ]}\"') ENDDAT",
    "a\r\nglobal boltpose_contact_1 = p[0,0,0,0,0,0]",
    "FOLD INI",
    ";ENDFOLD",
    "螺栓 №1",
    "-" * 300,
    "\x00\x1b[2J\u202eab",
    "=cmd|'/C calc'!A0",
    "!;!;",
    "",
]


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("text", HOSTILE)
def test_a_bolt_may_be_called_anything(name: str, text: str) -> None:
    scene = result(
        bolt(text or "T1", name=text, tool=text, order=1),
        bolt("B2", visibility=Visibility.HIDDEN, name=text),
        bolt("B3", is_sure=False, remarks=(text,)),
        bolt("B4", state=BoltState.CONTRADICTED, state_reason=text),
    )
    scene = replace(scene, prior_name=text)
    everything = RobotConfig(include_hidden=True, include_unsure=True, include_contradicted=True)
    for config in (RobotConfig(), everything):
        check_round_trip(plan_tools(scene, config), name)  # the readers refuse any odd line


def test_no_cell_of_the_table_is_a_formula() -> None:
    scene = result(bolt("+T1", name="=1+1", tool="@x"))
    row = robot_file(plan_tools(scene), RobotFormat.CSV).decode().splitlines()[1]
    assert row.startswith("1,'+T1,'=1+1,'@x,")


def test_umlauts_are_spelled_out() -> None:
    assert plain_text("Schraube für Ölwanne, 10°, é") == "Schraube fuer Oelwanne, 10deg, e"
    assert plain_text("a\tb\r\n c") == "a b c"
    assert plain_text("u\u0308") == "ue"  # the same letter in two characters


@pytest.mark.parametrize("name", [one.value for one in RobotFormat])
def test_the_same_input_gives_the_same_bytes(name: str) -> None:
    plan = plan_tools(of_axes(random_axes(5)))
    again = plan_tools(of_axes(random_axes(5)))
    assert robot_file(plan, RobotFormat(name)) == robot_file(again, RobotFormat(name))


def test_the_scan_id_of_several_scans_is_that_of_the_first() -> None:
    scene = result(bolt())
    several = replace(scene, provenance={"scan_sha256": ["ff" * 32, "ee" * 32]})
    assert scan_id(plan_tools(several)) == "ff" * 6
    head = READERS["kuka"](robot_file(plan_tools(several), RobotFormat.KUKA)).head
    assert "ff" * 32 in head
    assert "ee" * 32 in head
    nowhere = replace(scene, provenance={})
    assert scan_id(plan_tools(nowhere)) == "unknown"


def test_fanuc_fills_registers_only_when_told_which() -> None:
    scene = of_axes(random_axes(3))
    read = read_fanuc(robot_file(plan_tools(scene), RobotFormat.FANUC))
    assert read.raw == []
    assert read.count == -1
    config = RobotConfig(fanuc_first_register=51, fanuc_count_register=7)
    read = read_fanuc(robot_file(plan_tools(scene, config), RobotFormat.FANUC))
    assert read.raw == [(51 + k, 1 + k) for k in range(9)]
    assert read.count == 3
    assert "PR[51] to PR[59]" in read.head
    with pytest.raises(ConfigError, match="needs PR"):
        robot_file(plan_tools(scene, RobotConfig(fanuc_first_register=31995)), RobotFormat.FANUC)


def test_fanuc_frames_and_configuration_are_those_of_the_cell() -> None:
    config = RobotConfig(fanuc_user_frame=3, fanuc_tool=5, fanuc_config="F D B, 0, -1, 1")
    text = robot_file(plan_tools(result(bolt()), config), RobotFormat.FANUC).decode()
    assert text.count("UF : 3, UT : 5,\t\tCONFIG : 'F D B, 0, -1, 1',") == 3


@pytest.mark.parametrize(
    ("robot_format", "name", "is_fine"),
    [
        ("kuka", "a" * 24, True),
        ("kuka", "a" * 25, False),
        ("abb", "a" * 32, True),
        ("abb", "a" * 33, False),
        ("fanuc", "a" * 36, True),
        ("fanuc", "a" * 37, False),
        ("kuka", "1bolts", False),
        ("abb", "böltchen", False),
        ("fanuc", "my bolts", False),
        ("abb", "Module", False),
        ("kuka", "enddat", False),
        ("urscript", "anything goes-1", True),
        ("csv", "anything goes-1", True),
    ],
)
def test_names_of_programs(tmp_path: Path, robot_format: str, name: str, is_fine: bool) -> None:
    kind = RobotFormat(robot_format)
    path = tmp_path / f"{name}{kind.suffixes[0]}"
    plan = plan_tools(result(bolt()))
    if is_fine:
        write_robot_file(path, plan, kind)
        assert path.read_bytes() == robot_file(plan, kind, name)
    else:
        with pytest.raises(InputFileError, match=re.escape(f"the name '{name}'")):
            write_robot_file(path, plan, kind)
        assert list(tmp_path.iterdir()) == []


def test_a_wrong_ending_and_a_wrong_format(tmp_path: Path) -> None:
    plan = plan_tools(result(bolt()))
    with pytest.raises(InputFileError, match=r"wanted \.dat"):
        write_robot_file(tmp_path / "bolts.src", plan, RobotFormat.KUKA)
    with pytest.raises(ConfigError, match="urscript, kuka, fanuc, abb, ros2-mcap, csv, got 'yask'"):
        robot_file(plan, "yask")
    assert list(tmp_path.iterdir()) == []


def test_the_table_names_every_unit() -> None:
    content = robot_file(plan_tools(result(bolt("T1", name="ä"))), RobotFormat.CSV)
    header, row, last = content.decode("utf-8").split("\r\n")
    columns = header.split(",")
    assert last == ""
    assert len(columns) == len(row.split(","))
    assert {"contact_x_mm", "approach_qw", "retreat_z_mm", "sigma_axis_deg"} <= set(columns)
    values = dict(zip(columns, row.split(","), strict=True))
    assert values["name"] == "ä"
    assert values["status"] == "ok"
    assert values["scan_sha256"] == SCAN_SHA256
    assert values["pose"] == "base_from_tool"
    assert read_table(content).count == 1
