"""`boltpose synth` as a user meets it; what data sets hold is tested in tests/unit/synthesis."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from boltpose.synthesis.write import Sample, SampleFile, sample_name
from tests.support import reman18
from tests.unit.cli.conftest import Run


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples without geometry, and no card of them."""

    def make(settings: object, number: int) -> Sample:
        del settings
        return Sample(
            name=sample_name(number),
            files=(SampleFile(name="prior.ply", data=b"ply"),),
            seconds=(("build", 0.5),),
            retries=("ValueError: empty",) if number == 1 else (),
        )

    monkeypatch.setattr("boltpose.synthesis.sample.make_motor_sample", make)
    monkeypatch.setattr("boltpose.synthesis.scene_sample.make_scene_sample", make)
    monkeypatch.setattr("boltpose.synthesis.card.write_card", lambda root: root / "README.md")


@pytest.mark.usefixtures("quick")
def test_motors_are_made_and_the_next_run_continues(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    first = run("synth", "motors", "-n", "2", "--seed", "7", "-o", folder)
    assert first.code == 0
    assert first.out.startswith("2 made, 0 were there; 1 draws made again; ")
    more = run("synth", "motors", "-n", "3", "--seed", "7", "-o", folder)
    assert more.out.startswith("1 made, 2 were there; 0 draws made again; ")
    assert run("synth", "motors", "-n", "3", "--seed", "7", "-o", folder).out.startswith("0 made")
    assert {path.name for path in folder.glob("motor_*")} == {
        *("motor_00000", "motor_00001", "motor_00002"),
    }


@pytest.mark.usefixtures("quick")
def test_other_settings_are_one_line_and_change_nothing(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    run("synth", "scenes", "-n", "1", "-o", folder)
    before = sorted(folder.rglob("*"))
    outcome = run("synth", "scenes", "-n", "2", "--views", "3", "-o", folder)
    assert outcome.code == 2
    assert "was begun with views 2, now 3 is asked for" in outcome.err
    assert outcome.err.count("\n") == 1
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("motors", "-n", "0", "-o", "DIR"), "number of motors must be 1 to 100000, got 0"),
        (("motors", "--families", "tractor", "-o", "DIR"), "family must be one of direct_closed"),
        (
            ("motors", "--workers", "0", "-n", "1", "-o", "DIR"),
            "'--workers': Input should be greater",
        ),
        (("motors", "--seed", "-1", "-o", "DIR"), "seed must be >= 0"),
        (("motors",), "Missing option '--output'"),
        (("scenes", "--clamps", "rope", "-o", "DIR"), "clamp must be one of v_blocks"),
        (("scenes", "--size", "big", "-o", "DIR"), "WIDTHxHEIGHT like 1224x1024, got 'big'"),
        (("scenes", "--views", "0", "-o", "DIR"), "views must be 1 to 1000, got 0"),
        (("model", "nothing.json", "-o", "DIR"), "nothing.json: found no such file"),
        (("spec", "--family", "tractor"), "got 'tractor'"),
        (("spec", "-o", "spec.txt"), "found the ending '.txt'"),
        (("card", "DIR"), "no motor_*/prior.ply"),
        (("preview", "DIR"), "no motor_*/prior.ply"),
        (("compare", "DIR"), "no motor_*/prior.ply"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], text: str
) -> None:
    folder = str(tmp_path / "set")
    outcome = run("synth", *(folder if word == "DIR" else word for word in arguments))
    assert outcome.code == 2
    assert text in outcome.err
    assert outcome.err.startswith("boltpose: ")
    assert outcome.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("quick")
def test_ctrl_c_ends_with_130(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(settings: object, number: int) -> Sample:
        raise KeyboardInterrupt

    monkeypatch.setattr("boltpose.synthesis.sample.make_motor_sample", stop)
    outcome = run("synth", "motors", "-n", "1", "-o", tmp_path / "set")
    assert outcome.code == 130
    assert outcome.err.startswith("boltpose: interrupted; whole motors are kept")


def test_a_specification_is_printed_or_written(run: Run, tmp_path: Path) -> None:
    printed = run("synth", "spec", "--family", "inertia", "--seed", "3")
    assert json.loads(printed.out)["family"] == "inertia"
    run("synth", "spec", "--family", "inertia", "--seed", "3", "-o", tmp_path / "mine.json")
    assert (tmp_path / "mine.json").read_text() == printed.out


def test_a_broken_specification_leaves_no_model(run: Run, tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text('{"housing": {"radius": 30}}')
    outcome = run("synth", "model", tmp_path / "mine.json", "-o", tmp_path / "model")
    assert outcome.code == 2
    assert "mine.json: found the unknown field housing.radius" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "model").exists()


def test_a_motor_that_cannot_be_is_refused_by_file_and_field(run: Run, tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text('{"solenoid": {"offset_mm": 30}}')
    outcome = run("synth", "model", tmp_path / "mine.json", "-o", tmp_path / "model")
    assert outcome.code == 2
    assert "mine.json: solenoid.offset_mm: 30 leaves -7.3 mm beside the yoke" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "model").exists()


def test_families_and_clamps_are_listed(run: Run) -> None:
    listed = run("synth", "families").out.split()
    assert {"families", "direct_closed", "outboard", "clamps", "v_blocks"} <= set(listed)


def test_compare_prints_a_table_alone(run: Run) -> None:
    outcome = run("synth", "compare", reman18.ROOT)
    assert outcome.out.startswith("| | reman18 |\n|---|---|\n| motors | 18 |\n")
    assert outcome.err == ""


def test_without_the_cluster_extra_the_install_line_is_shown(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    outcome = run("synth", "motors", "-n", "1", "--cluster", "auto", "-o", tmp_path / "set")
    assert outcome.code == 2
    assert outcome.err == "boltpose: this needs ray: pip install 'boltpose[cluster]'\n"
    assert list(tmp_path.iterdir()) == []
