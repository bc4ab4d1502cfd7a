from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from boltpose.errors import ConfigError, InputFileError
from boltpose.synthesis.folder import locked, open_folder, read_settings
from boltpose.synthesis.run import WorkerDiedError, run_data_set, run_local
from boltpose.synthesis.write import Sample, SampleFile, sample_name, write_sample
from tests.support.toy_samples import SETTINGS, make_toy, make_toy_or_die, make_toy_or_stop


def tree_bytes(root: Path) -> dict[str, bytes]:
    """Every file of a folder but the lock, which holds nothing."""
    return {
        str(path.relative_to(root)): path.read_bytes()
        for path in sorted(root.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Five samples made in one go by one process."""
    root = tmp_path_factory.mktemp("whole")
    run = run_data_set(root, SETTINGS, 5, make_toy, run_local)
    assert (run.made, run.kept) == (5, 0)
    return tree_bytes(root)


def test_the_bytes_do_not_depend_on_the_number_of_workers(
    tmp_path: Path, whole: dict[str, bytes]
) -> None:
    run_data_set(tmp_path, SETTINGS, 5, make_toy, partial(run_local, workers=2))
    assert tree_bytes(tmp_path) == whole


def test_a_data_set_made_in_steps_is_the_one_made_at_once(
    tmp_path: Path, whole: dict[str, bytes]
) -> None:
    run_data_set(tmp_path, SETTINGS, 2, make_toy, run_local)
    run = run_data_set(tmp_path, SETTINGS, 5, make_toy, run_local)
    assert (run.made, run.kept) == (3, 2)
    assert tree_bytes(tmp_path) == whole


def test_finished_samples_are_not_made_again(tmp_path: Path) -> None:
    run_data_set(tmp_path, SETTINGS, 3, make_toy, run_local)

    def never(settings: object, number: int) -> Sample:
        raise AssertionError(number)

    assert run_data_set(tmp_path, SETTINGS, 3, never, run_local).made == 0


def test_ctrl_c_leaves_whole_samples_and_the_next_run_goes_on(
    tmp_path: Path, whole: dict[str, bytes]
) -> None:
    with pytest.raises(KeyboardInterrupt):
        run_data_set(tmp_path, SETTINGS, 5, make_toy_or_stop, run_local)
    assert {path.name for path in tmp_path.iterdir()} == {
        *("dataset.json", ".lock", "motor_00000", "motor_00001"),
    }
    run_data_set(tmp_path, SETTINGS, 5, make_toy, run_local)
    assert tree_bytes(tmp_path) == whole


def test_what_a_killed_run_left_is_made_anew(tmp_path: Path, whole: dict[str, bytes]) -> None:
    open_folder(tmp_path, SETTINGS)
    half = tmp_path / f".{sample_name(1)}.4711-abcd.part"
    half.mkdir()
    (half / "prior.ply").write_bytes(b"half")
    run_data_set(tmp_path, SETTINGS, 5, make_toy, run_local)
    assert tree_bytes(tmp_path) == whole


def test_a_dead_worker_is_one_line_and_costs_no_finished_sample(
    tmp_path: Path, whole: dict[str, bytes]
) -> None:
    with pytest.raises(WorkerDiedError, match="finished motors are kept"):
        run_data_set(tmp_path, SETTINGS, 5, make_toy_or_die, partial(run_local, workers=2))
    run_data_set(tmp_path, SETTINGS, 5, make_toy, run_local)
    assert tree_bytes(tmp_path) == whole


def test_a_disk_that_fails_leaves_nothing_half_written(tmp_path: Path) -> None:
    # two files of one name: the second cannot be written, as on a full disk
    files = (SampleFile(name="a/b", data=b"1"), SampleFile(name="a/b", data=b"2"))
    with pytest.raises(FileExistsError):
        write_sample(tmp_path, Sample(name="motor_00000", files=files))
    assert list(tmp_path.iterdir()) == []


def test_other_settings_are_refused_by_name(tmp_path: Path) -> None:
    open_folder(tmp_path, SETTINGS)
    with pytest.raises(ConfigError, match="begun with seed 3, now 4 is asked for"):
        open_folder(tmp_path, replace(SETTINGS, seed=4))
    with pytest.raises(ConfigError, match="begun with families"):
        open_folder(tmp_path, replace(SETTINGS, families=("a",)))
    assert read_settings(tmp_path) == SETTINGS


def test_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    open_folder(tmp_path, SETTINGS)
    monkeypatch.setattr("boltpose.__version__", "99.0")
    with pytest.raises(ConfigError, match=r"this is 99\.0"):
        open_folder(tmp_path, SETTINGS)


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.docx").write_text("mine")
    with pytest.raises(InputFileError, match=r"'thesis\.docx' and no dataset\.json"):
        open_folder(tmp_path, SETTINGS)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.docx"]


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"format": "boltpose.dataset/1"}'])
def test_a_damaged_dataset_json_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "dataset.json").write_text(text)
    with pytest.raises(InputFileError, match=r"dataset\.json: found"):
        open_folder(tmp_path, SETTINGS)


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    second = locked(tmp_path)
    with locked(tmp_path), pytest.raises(InputFileError, match="another run at work"):
        second.__enter__()


@pytest.mark.parametrize("count", [0, -1, 100_001])
def test_counts_out_of_range_are_refused(tmp_path: Path, count: int) -> None:
    with pytest.raises(ConfigError, match="1 to 100000"):
        run_data_set(tmp_path / "new", SETTINGS, count, make_toy, run_local)
    assert not (tmp_path / "new").exists()


def test_workers_must_be_at_least_one() -> None:
    with pytest.raises(ConfigError, match="workers must be >= 1"):
        list(run_local(partial(make_toy, SETTINGS), [0], workers=0))


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_in_a_terminal_ends_all_workers_at_once(tmp_path: Path) -> None:
    code = (
        "import sys; from functools import partial; from pathlib import Path\n"
        "from boltpose.synthesis.run import run_data_set, run_local\n"
        "from tests.support.toy_samples import SETTINGS, make_sleepy_toy\n"
        "run_data_set(Path(sys.argv[1]), SETTINGS, 4, make_sleepy_toy, "
        "partial(run_local, workers=2))\n"
    )
    root = tmp_path / "set"
    process = subprocess.Popen(
        [sys.executable, "-c", code, root],
        cwd=Path(__file__).parents[3],
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    until = time.monotonic() + 60
    while not (root / "motor_00000").exists() and time.monotonic() < until:
        time.sleep(0.05)
    # as a terminal does it: to the whole group of processes
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(timeout=60) != 0
    assert {path.name for path in root.iterdir()} == {"dataset.json", ".lock", "motor_00000"}
    # the last one of the group, Python's resource tracker, sees that its parent is gone and goes
    while _lives(process.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert not _lives(process.pid)


def _lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
