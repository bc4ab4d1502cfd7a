"""The examples of `docs/robot-formats.md` are what the writers write, to the letter."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from boltpose.robot import RobotConfig, RobotFormat, bop_text, plan_tools, robot_file
from boltpose.schema import BoltState, Visibility
from tests.unit.robot.bolts import bolt, result
from tests.unit.robot.test_bop import TARGET, located, read_bop

DOCS = Path(__file__).parents[3] / "docs" / "robot-formats.md"


def documented_plan():
    """One bolt that looks up and leans a little, one that is hidden."""
    scene = result(
        bolt("B3", (0.02, -0.01, 1.0), (563.948, -144.063, 314.959), name="flange left",
             tool="hex 8", order=1, p_tool_fits=0.981, state=BoltState.CONFIRMED),
        bolt("T1", (0, 0, -1), (578.1, -78.1, 177.9), visibility=Visibility.HIDDEN),
    )  # fmt: skip
    return plan_tools(scene, RobotConfig(fanuc_first_register=51, fanuc_count_register=10))


def blocks(name: str) -> list[str]:
    text = DOCS.read_text(encoding="utf-8")
    section = text.split(f"<!-- example {name} -->", 1)[1]
    return [re.match(r"\n+```[a-z]*\n(.*?)```", section, re.DOTALL)[1].rstrip("\n")]


@pytest.mark.parametrize("name", ["urscript", "kuka", "fanuc", "abb", "csv"])
def test_examples(name: str) -> None:
    written = robot_file(documented_plan(), RobotFormat(name), "bolts").decode()
    for block in blocks(name):
        assert len(block.splitlines()) >= 2
        assert block in written.replace("\r\n", "\n")


def test_the_example_of_bop() -> None:
    (block,) = blocks("bop-csv")
    assert block + "\n" == bop_text(located(), TARGET, seconds=0.94)
    assert read_bop(block)


def test_every_setting_is_in_the_table_and_the_example_is_valid() -> None:
    text = DOCS.read_text(encoding="utf-8")
    for field in fields(RobotConfig):
        assert f"`{field.name}`" in text, field.name
    (block,) = blocks("toml")
    RobotConfig(**tomllib.loads(block)["robot"])
