from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from boltpose.errors import ConfigError, InputFileError
from boltpose.evaluation.study_claims import claim, claimant
from boltpose.evaluation.study_clock import CpuClock, read_cpu_s
from boltpose.evaluation.study_records import (
    StudyRecord,
    read_study_record,
    read_study_records,
    record_path,
    score_study,
    thin_losses,
    write_study_record,
)
from boltpose.evaluation.study_run import StudyEvents, run_study
from tests.unit.evaluation.study_samples import CountingTrainer, plan, record, row

RUNS = plan("table3", only=("2048", "2048 pretrain", "4096 pretrain warm-up"))


def without_times(folder: Path) -> dict[str, dict[str, object]]:
    found = {path.name: json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))}
    for one in found.values():
        assert one.pop("cpu_s") >= 0
        one.pop("pretraining_cpu_s")
    return found


def test_every_run_leaves_a_record_and_pretraining_is_done_once(tmp_path: Path) -> None:
    trainer = CountingTrainer()

    records = run_study(RUNS, trainer, out=tmp_path / "out", work=tmp_path / "work")

    assert [one.run for one in records] == [run.name for run in RUNS]
    assert [one.settings for one in records] == [run.settings for run in RUNS]
    assert sorted(read_study_records(tmp_path / "out"), key=lambda one: one.run) == sorted(
        records, key=lambda one: one.run
    )
    begun = [name for name in trainer.trained if name.startswith("pretrain_")]
    assert len(begun) == 2  # 2048 and 4096 points
    assert len(trainer.trained) == len(RUNS) + 2
    assert not list(tmp_path.rglob("*.claim"))
    for one in records:
        assert one.scores == score_study(one.confusion, one.classes)
        assert (one.pretraining_cpu_s is None) == (one.settings.pretraining is None)


def test_the_same_runs_give_the_same_records(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run_study(RUNS, CountingTrainer(), out=tmp_path / name, work=tmp_path / f"work_{name}")

    assert without_times(tmp_path / "a") == without_times(tmp_path / "b")


def test_only_what_is_missing_is_run_again(tmp_path: Path) -> None:
    out, work = tmp_path / "out", tmp_path / "work"
    first = run_study(RUNS, CountingTrainer(), out=out, work=work)
    record_path(out, RUNS[1].name).unlink()
    trainer = CountingTrainer()
    told: list[tuple[str, bool]] = []

    again = run_study(
        RUNS,
        trainer,
        out=out,
        work=work,
        events=StudyEvents(on_run=lambda one, is_new: told.append((one.run, is_new))),
    )

    assert trainer.trained == []  # the network was there, its record alone was missing
    assert [name for name, is_new in told if is_new] == [RUNS[1].name]
    assert [one.confusion for one in again] == [one.confusion for one in first]


def test_an_interrupted_training_goes_on_and_gives_the_same(tmp_path: Path) -> None:
    class Killed(Exception):
        pass

    def kill(out: Path, step: int) -> None:
        if out.name.startswith("pct-small_4096") and step == 2:
            raise Killed

    out, work = tmp_path / "out", tmp_path / "work"
    with pytest.raises(Killed):
        run_study(RUNS, CountingTrainer(before_step=kill), out=out, work=work)
    assert 0 < len(read_study_records(out)) < len(RUNS)
    spent = max(read_cpu_s(path) for path in work.glob("*.cpu_s"))
    trainer = CountingTrainer()
    run_study(RUNS, trainer, out=out, work=work)
    run_study(RUNS, CountingTrainer(), out=tmp_path / "whole", work=tmp_path / "work_whole")

    assert without_times(out) == without_times(tmp_path / "whole")
    assert not any(name.startswith("pretrain_") for name in trainer.trained)
    assert max(read_cpu_s(path) for path in work.glob("*.cpu_s")) >= spent


def test_the_claim_of_a_killed_process_holds_nobody_up(tmp_path: Path) -> None:
    out, work = tmp_path / "out", tmp_path / "work"
    work.mkdir()
    path = work / f"{RUNS[0].name}.claim"
    killed = (
        "import os, signal, sys; from pathlib import Path\n"
        "from boltpose.evaluation.study_claims import claim\n"
        "with claim(Path(sys.argv[1])) as is_mine:\n"
        "    assert is_mine\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert subprocess.run([sys.executable, "-c", killed, str(path)], check=False).returncode < 0
    assert path.exists()
    assert claimant(path).startswith("process ")

    records = run_study(RUNS, CountingTrainer(), out=out, work=work)

    assert len(records) == len(RUNS)
    assert not path.exists()


def test_what_another_process_does_is_left_to_it_and_waited_for(tmp_path: Path) -> None:
    out, work = tmp_path / "out", tmp_path / "work"
    work.mkdir()
    busy = RUNS[0]
    trainer = CountingTrainer()
    waited: list[str] = []
    order: list[tuple[str, bool]] = []
    other = claim(work / f"{busy.name}.claim")

    def finish_elsewhere(seconds: float) -> None:
        assert seconds > 0
        run_study(RUNS[:1], CountingTrainer(), out=tmp_path / "b", work=tmp_path / "work_b")
        write_study_record(out, read_study_record(record_path(tmp_path / "b", busy.name)))
        other.__exit__(None, None, None)

    with claim(work / "x.claim") as is_free:
        assert is_free
    assert other.__enter__()
    records = run_study(
        RUNS,
        trainer,
        out=out,
        work=work,
        events=StudyEvents(
            on_run=lambda one, is_new: order.append((one.run, is_new)),
            on_wait=waited.append,
            wait=finish_elsewhere,
        ),
    )

    assert [one.run for one in records] == [run.name for run in RUNS]
    assert order == [*((run.name, True) for run in RUNS[1:]), (busy.name, False)]
    assert len(waited) == 1
    assert waited[0].startswith("process ")
    assert not any(name.startswith(busy.name) for name in trainer.trained)


_BESIDE = """
import sys, time
from pathlib import Path
from boltpose.evaluation.study_run import StudyEvents, run_study
from tests.unit.evaluation.study_samples import CountingTrainer
from tests.unit.evaluation.test_study_run import RUNS

folder = Path(sys.argv[1])
trainer = CountingTrainer(before_step=lambda out, step: time.sleep(0.02))
(folder / f"ready_{sys.argv[2]}").touch()
while len(list(folder.glob("ready_*"))) < 2:
    time.sleep(0.01)
run_study(RUNS, trainer, out=folder / "out", work=folder / "work",
          events=StudyEvents(wait=lambda seconds: time.sleep(0.02)))
print("\\n".join(trainer.trained))
"""


def test_two_processes_at_once_share_the_work_and_do_nothing_twice(tmp_path: Path) -> None:
    beside = [
        subprocess.Popen(
            [sys.executable, "-c", _BESIDE, str(tmp_path), name], stdout=subprocess.PIPE, text=True
        )
        for name in "ab"
    ]
    trained = [process.communicate()[0].split() for process in beside]
    alone = CountingTrainer()
    run_study(RUNS, alone, out=tmp_path / "alone", work=tmp_path / "work_alone")

    assert [process.returncode for process in beside] == [0, 0]
    assert sorted([*trained[0], *trained[1]]) == sorted(alone.trained)
    assert without_times(tmp_path / "out") == without_times(tmp_path / "alone")
    assert not list(tmp_path.rglob("*.claim"))


def test_runs_wait_for_a_pretraining_that_another_process_does(tmp_path: Path) -> None:
    trainer = CountingTrainer()
    runs = plan("table3", only=("2048 pretrain", "2048"))
    run_study(runs, trainer, out=tmp_path / "a", work=tmp_path / "work_a")
    (name,) = (name for name in trainer.trained if name.startswith("pretrain_"))
    work = tmp_path / "work"
    work.mkdir()
    other = claim(work / f"{name}.claim")
    assert other.__enter__()
    done: list[str] = []

    def finish_elsewhere(seconds: float) -> None:
        (work / name).mkdir()
        weights = "weights.safetensors"
        (work / name / weights).write_text((tmp_path / "work_a" / name / weights).read_text())
        other.__exit__(None, None, None)

    run_study(
        runs,
        CountingTrainer(),
        out=tmp_path / "out",
        work=work,
        events=StudyEvents(on_run=lambda one, is_new: done.append(one.run), wait=finish_elsewhere),
    )

    from_scratch = [run.name for run in runs if run.settings.pretraining is None]
    assert done == from_scratch + [run.name for run in runs if run.settings.pretraining]
    assert without_times(tmp_path / "out") == without_times(tmp_path / "a")


def test_other_settings_are_refused_before_anything_runs_and_redone_when_asked(
    tmp_path: Path,
) -> None:
    out, work = tmp_path / "out", tmp_path / "work"
    run_study(RUNS[:2], CountingTrainer(), out=out, work=work)
    now = plan("table3", only=("2048", "2048 pretrain", "4096 pretrain warm-up"), budget="study")
    trainer = CountingTrainer()
    before = {path: path.read_bytes() for path in out.iterdir()}

    with pytest.raises(ConfigError, match=r"training\.epochs: 1\.0 there, .* now\): --redo"):
        run_study(now, trainer, out=out, work=work)
    assert trainer.trained == []
    assert {path: path.read_bytes() for path in out.iterdir()} == before

    records = run_study(now, trainer, out=out, work=work, redo=True)
    assert [one.settings for one in records] == [run.settings for run in now]
    assert len({name for name in trainer.trained if not name.startswith("pretrain_")}) == len(now)


def test_a_record_comes_back_as_it_was(tmp_path: Path) -> None:
    one = record(row("table2", "pct"), "split1", 90)

    path = write_study_record(tmp_path, one)

    assert read_study_record(path) == one
    assert len(path.read_text().splitlines()) == len(StudyRecord.__dataclass_fields__) + 2


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "boltpose.study/0"}', '{"run": 1}'])
def test_what_is_no_record_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "pct_2048_split0.json"
    path.write_text(text)
    with pytest.raises(InputFileError, match=r"pct_2048_split0\.json: found .* wanted"):
        read_study_records(tmp_path)


def test_scores_are_those_of_the_definition() -> None:
    scores = score_study(((8, 2, 0), (1, 4, 0), (0, 0, 0)), ("a", "b", "c"))

    assert scores.overall_accuracy == pytest.approx(12 / 15, abs=1e-6)
    assert scores.iou == {
        "a": pytest.approx(8 / 11, abs=1e-6),
        "b": pytest.approx(4 / 7, abs=1e-6),
    }
    assert scores.mean_iou == pytest.approx((8 / 11 + 4 / 7) / 2, abs=1e-6)
    with pytest.raises(ValueError, match="must count points of 2 classes"):
        score_study(((0, 0), (0, 0)), ("a", "b"))


def test_thinned_losses_keep_the_mean_of_all_steps_and_the_last_step() -> None:
    losses = [float(step) for step in range(137)]

    thin = thin_losses(losses, 10)

    assert len(thin) == 10
    assert thin[-1].step == 137
    starts = [0, *(point.step for point in thin[:-1])]
    weights = [point.step - start for start, point in zip(starts, thin, strict=True)]
    total = sum(w * point.loss for w, point in zip(weights, thin, strict=True))
    assert total == pytest.approx(sum(losses), abs=0.01)
    assert [point.loss for point in thin_losses(losses[:3])] == losses[:3]
    assert thin_losses([]) == ()


def test_processor_time_adds_up_over_attempts(tmp_path: Path) -> None:
    path = tmp_path / "x.cpu_s"
    path.write_text("100.0\n")

    with pytest.raises(ValueError, match="interrupted"), CpuClock(path):
        raise ValueError("interrupted")

    assert 100.0 <= read_cpu_s(path) < 101.0
    assert read_cpu_s(tmp_path / "none") == 0
