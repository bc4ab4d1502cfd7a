from __future__ import annotations

import json
from pathlib import Path

import pytest

import boltpose.cli.study_trainer
from boltpose.cli.reproduce import BudgetName, Table
from boltpose.evaluation.study_records import read_study_records, write_study_record
from boltpose.evaluation.study_rows import BUDGETS, TABLES
from tests.unit.cli.conftest import Run
from tests.unit.evaluation.study_samples import FAMILIES, CountingTrainer, record, row


@pytest.fixture
def data(tmp_path: Path) -> Path:
    root = tmp_path / "data"
    for motor, family in FAMILIES.items():
        folder = root / motor
        folder.mkdir(parents=True)
        (folder / "prior.ply").write_bytes(b"")
        (folder / "prior_gt.json").write_text(json.dumps({"family_name": family}))
    return root


@pytest.fixture
def trainer(monkeypatch: pytest.MonkeyPatch) -> CountingTrainer:
    trainer = CountingTrainer()
    monkeypatch.setattr(
        boltpose.cli.study_trainer, "PlainTrainer", lambda data, *, workers: trainer
    )
    return trainer


def places(folder: Path) -> list[str | Path]:
    return ["--out", folder / "out", "--work", folder / "work", "--cache", folder / "cache"]


def test_the_command_knows_every_table_and_budget() -> None:
    assert {table.value for table in Table} == {*TABLES, "all", "table1"}
    assert {budget.value for budget in BudgetName} == set(BUDGETS)


def test_a_table_is_run_and_printed_and_a_second_call_runs_nothing(
    run: Run, data: Path, tmp_path: Path, trainer: CountingTrainer
) -> None:
    call = ["reproduce", "table2", "--data", data, "--synthetic", data, "--budget", "quick",
            "--only", "pct", "--only", "pointnet", *places(tmp_path)]  # fmt: skip

    outcome = run(*call)

    assert outcome.code == 0
    assert len(read_study_records(tmp_path / "out")) == 10
    assert outcome.err.count("\n") == 10  # a line per run
    assert "10/10  pct_2048_split4: OA " in outcome.err
    assert "| pct | 0.00 M | 5 |" in outcome.out
    begun = len(trainer.trained)
    again = run(*call)
    assert (again.code, again.err, again.out) == (0, "", outcome.out)
    assert len(trainer.trained) == begun == 12
    assert run("reproduce", "table2", "--report-only", *places(tmp_path)).out == outcome.out


def test_json_is_all_that_is_printed(run: Run, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_study_record(tmp_path / "out", record(row("table2", "pct"), "split0", 90))

    outcome = run("reproduce", "all", "--report-only", "--json", *places(tmp_path))

    assert json.loads(outcome.out)["table2"]["pct"]["overall accuracy"]["mean"] == 90
    assert outcome.err == ""


def test_the_curve_is_drawn(run: Run, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_study_record(tmp_path / "out", record(row("curve", "pct-small x2"), "split0", 90))
    picture = tmp_path / "curve.png"

    outcome = run("reproduce", "curve", "--report-only", "--picture", picture, *places(tmp_path))

    assert outcome.code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("names", "arguments"),
    [
        ("--synthetic", ["table2", "--data", "DATA"]),
        ("--synthetic-scenes", ["binary", "--data", "DATA", "--synthetic", "DATA"]),
        ("nowhere", ["table2", "--data", "nowhere"]),
        ("pointnett", ["table2", "--data", "DATA", "--synthetic", "DATA", "--only", "pointnett"]),
        ("no record", ["all", "--report-only"]),
        (".gif", ["curve", "--report-only", "--picture", "curve.gif"]),
        ("table4", ["table4"]),
    ],
)
def test_bad_input_ends_in_one_line_and_leaves_nothing(
    run: Run, data: Path, tmp_path: Path, names: str, arguments: list[str]
) -> None:
    given = [str(data) if text == "DATA" else text for text in arguments]

    outcome = run("reproduce", *given, *places(tmp_path))

    assert outcome.code == 2
    assert outcome.out == ""
    assert outcome.err.startswith("boltpose: ")
    assert outcome.err.count("\n") == 1, outcome.err
    assert names in outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_an_interruption_keeps_what_is_done(
    run: Run, data: Path, tmp_path: Path, trainer: CountingTrainer
) -> None:
    def interrupt(out: Path, step: int) -> None:
        if out.name.startswith("pct_2048_split0"):
            raise KeyboardInterrupt

    trainer.before_step = interrupt
    call = ["reproduce", "table2", "--data", data, "--synthetic", data, *places(tmp_path)]

    outcome = run(*call)

    assert outcome.code == 130
    assert outcome.err.splitlines()[-1].startswith("boltpose: interrupted; finished runs are kept")
    assert len(read_study_records(tmp_path / "out")) == 3
    trainer.before_step = lambda out, step: None
    assert run(*call).code == 0
    assert len(read_study_records(tmp_path / "out")) == 20
