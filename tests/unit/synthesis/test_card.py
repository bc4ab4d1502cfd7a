from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from boltpose.errors import InputFileError
from boltpose.synthesis.card import write_card
from boltpose.synthesis.compare import compare_table
from boltpose.synthesis.preview import shade_depth, write_previews
from boltpose.synthesis.statistics import read_statistics
from tests.support import reman18

MOTOR = "motor_00000"


def test_the_statistics_of_reman18_are_those_of_its_readme() -> None:
    data = read_statistics(reman18.ROOT)
    readme = (reman18.ROOT / "README.md").read_text()
    total = data.class_points.sum()
    for name, count in zip(
        ("main_housing", "connector", "solenoid", "electrical_connector", "gear", "bolt"),
        data.class_points,
        strict=True,
    ):
        assert f"{name} {count:.0f} ({100 * count / total:.1f} %)" in readme
    assert len(data.motors) == 18
    assert len(data.views) == 72
    hidden = np.array([view.hidden_share for view in data.views])
    assert f"not visible: median {100 * np.median(hidden):.0f} %" in readme
    for motor in data.motors:
        shares = " ".join(f"{100 * view.hidden_share:.0f}%" for view in motor.views)
        row = f"| {motor.name} | {motor.family} | {motor.scan_points} | {len(motor.bolts)} | "
        assert f"{row}{shares} |" in readme


def test_the_card_says_what_is_on_disk_and_how_to_make_it_again(scenes: Path) -> None:
    text = write_card(scenes).read_text()
    truth = json.loads((scenes / MOTOR / "prior_gt.json").read_text())
    views = json.loads((scenes / MOTOR / "bolts.json").read_text())
    assert "**This data set is simulated**" in text
    command = (
        "boltpose synth scenes -n 1 --seed 5 --families motorcycle --views 2 --size 612x512 "
        "--clamps v_blocks,parallel_vice -o DIR"
    )
    assert command in text
    assert f"| {MOTOR} | motorcycle | {truth['n_points']} | {truth['n_bolts']} |" in text
    for name, count in truth["class_points"].items():
        assert f"| {name} | {count} |" in text
    histogram = re.search(r"\| bolts \| ([\d |]+) \|", text)
    assert histogram is not None
    counted = sum(int(cell) for cell in histogram[1].split(" | "))
    assert counted == sum(bolt["present"] for view in views.values() for bolt in view["bolts"])


def test_the_card_shows_the_previews(scenes: Path, tmp_path: Path) -> None:
    root = tmp_path / "copy"
    shutil.copytree(scenes, root)
    shutil.rmtree(root / "preview", ignore_errors=True)
    assert "preview/" not in write_card(root).read_text()
    for path in write_previews(root):
        with Image.open(path) as image:
            assert len(np.unique(np.asarray(image).reshape(-1, 3), axis=0)) > 100
        assert f"]({path.relative_to(root).as_posix()})" in write_card(root).read_text()


def test_data_sets_stand_side_by_side(scenes: Path) -> None:
    ours, theirs = read_statistics(scenes), read_statistics(reman18.ROOT)
    table = compare_table([ours, theirs], ["ours", "reman18"])
    lines = table.splitlines()
    assert lines[0] == "| | ours | reman18 |"
    assert {line.count("|") for line in lines} == {4}
    assert f"| bolts per motor | {len(ours.bolts)} / {len(ours.bolts)} / {len(ours.bolts)} |" in (
        table
    )
    assert "| 7 / 9 / 11 |" in table


def test_a_folder_without_motors_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"no motor_\*/prior\.ply"):
        read_statistics(tmp_path)


def test_a_wall_is_lit_evenly_and_darker_when_it_turns_away() -> None:
    facing = np.full((40, 40), 700.0)
    light = shade_depth(facing, 1000.0)
    assert np.ptp(light) < 1e-9
    # 45 degrees: a pixel further in depth by as much as a pixel is wide
    turned = facing + 0.7 * np.arange(40)
    assert shade_depth(turned, 1000.0)[20, 20] < light[20, 20] - 0.2
    facing[10, 10] = 0
    assert shade_depth(facing, 1000.0)[10, 10] == 0
