from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boltpose.datasets.reman18 import Reman18
from boltpose.errors import ConfigError, InputFileError
from boltpose.evaluation.study_paper import EFFECTS, PAPER
from boltpose.evaluation.study_plan import draw_splits, leave_family_out, plan_run
from boltpose.evaluation.study_rows import BUDGETS, ROWS, TABLES, VIEWS
from boltpose.evaluation.study_settings import digest_of, mark_data
from tests.unit.evaluation.study_samples import DATA, FAMILIES, SCENES, SYNTHETIC, plan, row

REMAN18 = Path(__file__).parents[3] / "data" / "reman18"


@settings(deadline=None)
@given(seed=st.integers(0, 2**32))
def test_splits_are_disjoint_of_two_families_each_and_even_over_families(seed: int) -> None:
    folds = draw_splits(FAMILIES, seed=seed)

    assert [fold.name for fold in folds] == [f"split{number}" for number in range(5)]
    tested = [motor for fold in folds for motor in fold.test]
    assert len(set(tested)) == 10
    for fold in folds:
        assert len({FAMILIES[motor] for motor in fold.test}) == 2
        assert sorted(fold.train + fold.test) == sorted(FAMILIES)
        assert len(fold.train) == 16
    assert set(Counter(FAMILIES[motor] for motor in tested).values()) == {1, 2}


def test_splits_of_reman18_are_written_down() -> None:
    data = Reman18(root=REMAN18)
    families = {motor: data.family(motor) for motor in reversed(data.motors)}

    assert [fold.test for fold in draw_splits(families)] == [
        ("motor_006", "motor_009"),
        ("motor_001", "motor_017"),
        ("motor_008", "motor_016"),
        ("motor_005", "motor_012"),
        ("motor_002", "motor_004"),
    ]


@pytest.mark.parametrize("motors", [0, 2, 9])
def test_too_few_motors_are_refused(motors: int) -> None:
    few = dict(list(FAMILIES.items())[:motors])
    with pytest.raises(ConfigError, match=f"from {motors} motors"):
        draw_splits(few)


def test_motors_of_one_family_are_refused() -> None:
    with pytest.raises(ConfigError, match="18 motors of 1 families"):
        draw_splits(dict.fromkeys(FAMILIES, "same"))


def test_leaving_out_a_family_tests_every_motor_once_and_trains_on_no_relative() -> None:
    folds = leave_family_out(FAMILIES)

    assert sorted(motor for fold in folds for motor in fold.test) == sorted(FAMILIES)
    for fold in folds:
        assert not {FAMILIES[m] for m in fold.test} & {FAMILIES[m] for m in fold.train}
        assert sorted(fold.train + fold.test) == sorted(FAMILIES)


def test_the_paper_has_a_number_for_every_row_of_its_tables() -> None:
    assert {table: list(rows) for table, rows in PAPER.items()} == {
        table: [row.name for row in ROWS[table]] for table in ("table2", "table3", "binary")
    }
    assert {name for effect in EFFECTS for name in (effect.before, effect.after)} == set(
        PAPER["table3"]
    )


def test_rows_of_a_table_differ_in_what_the_paper_varies_and_in_nothing_else() -> None:
    assert len({replace(r, name="", backbone="") for r in ROWS["table2"]}) == 1
    assert len({r.backbone for r in ROWS["table3"]}) == 1
    assert {(r.points, r.is_pretrained, r.has_warm_up, r.epochs) for r in ROWS["table3"]} == {
        (2048, False, False, 1),
        (2048, False, True, 1),
        (2048, True, False, 1),
        (2048, True, True, 1),
        (1024, True, True, 1),
        (4096, True, True, 1),
        (4096, True, True, 2),
    }


def test_every_split_has_all_rows_before_the_next_begins_the_cheapest_first() -> None:
    runs = plan("table2", "table3", "binary")

    assert [fold for fold, _ in groupby(runs, key=lambda run: run.fold)] == [
        f"split{number}" for number in range(5)
    ]
    for _, of_fold in groupby(runs, key=lambda run: run.fold):
        costs = [run.cost for run in of_fold]
        assert len(costs) == 4 + 7 + 1
        assert costs == sorted(costs)


def test_all_runs_the_papers_tables_then_the_curve_then_families_and_nothing_twice() -> None:
    runs = plan(*TABLES)

    names = [run.name for run in runs]
    assert len(set(names)) == len(names)
    # the unit budget of both curves is a run of tables 2 and 3
    assert len(runs) == 5 * (4 + 7 + 1) + (8 - 2) + 6 * 4
    assert [kind for kind, _ in groupby(runs, key=lambda run: run.fold.split("-")[0])] == [
        *(f"split{number}" for number in range(5)),
        "split0",
        "without",
    ]


def test_a_row_means_the_same_run_in_every_table() -> None:
    for one in plan("curve", "table2"):
        for other in plan("table3", "honest", "binary", "table2"):
            assert (one.name == other.name) == (one.settings == other.settings)


def test_all_rows_have_one_budget_and_one_pretraining_per_network() -> None:
    runs = plan("table2", "table3", "binary", budget="study")

    budget = BUDGETS["study"]
    for run in runs:
        settings = run.settings.training
        scans = VIEWS if settings.task == "scene" else 1
        factor = 2 if "_x2_" in run.name else 1
        assert settings.epochs == budget.epochs * factor
        assert settings.points_per_epoch * scans == budget.points_per_epoch
        assert settings.warm_up_epochs == (0 if "_cold_" in run.name else budget.warm_up_epochs)
        before = run.settings.pretraining
        assert (before is None) == ("_scratch_" in run.name)
        if before is not None:
            points = before.epochs * before.data.motors * scans * before.points_per_epoch
            assert points == pytest.approx(budget.pretraining_clouds * 2048)
    pretrainings = {run.settings.pretraining for run in runs} - {None}
    keys = {(p.task, p.backbone, p.points) for p in pretrainings if p is not None}
    assert len(keys) == len(pretrainings)


def test_only_keeps_a_row_and_refuses_a_name_that_is_none() -> None:
    assert {run.settings.training.backbone for run in plan("table2", only=("dgcnn",))} == {"dgcnn"}
    with pytest.raises(ConfigError, match=r"row must be one of .*'dgcnn'.*, got 'dgnn'"):
        plan("table2", only=("dgnn",))


def test_an_unknown_table_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"table must be one of table2, .* got 'table9'"):
        plan("table9")


@pytest.mark.parametrize(("table", "option"), [("table2", "motors"), ("binary", "scenes")])
def test_pretraining_without_data_names_the_option(table: str, option: str) -> None:
    fold = draw_splits(FAMILIES)[0]
    with pytest.raises(ConfigError, match=f"--synthetic.* `boltpose synth {option}`"):
        plan_run(ROWS[table][0], fold, BUDGETS["quick"], data=DATA, synthetic=None)


def test_digests_differ_when_anything_differs() -> None:
    fold, other = draw_splits(FAMILIES)[:2]
    quick = BUDGETS["quick"]
    plans = [
        plan_run(row("table2", "pct"), fold, quick, data=DATA, synthetic=SYNTHETIC),
        plan_run(row("table2", "pct"), fold, quick, data=DATA, synthetic=SCENES),
        plan_run(row("table2", "pct"), other, quick, data=DATA, synthetic=SYNTHETIC),
        plan_run(row("table2", "pct"), fold, BUDGETS["study"], data=DATA, synthetic=SYNTHETIC),
        plan_run(row("table2", "dgcnn"), fold, quick, data=DATA, synthetic=SYNTHETIC),
    ]
    assert len({digest_of(one.settings) for one in plans}) == len(plans)


def test_a_data_set_is_known_by_its_files_wherever_it_lies(tmp_path: Path) -> None:
    for name in ("here", "there"):
        for motor in ("motor_0", "motor_1"):
            folder = tmp_path / name / motor
            folder.mkdir(parents=True)
            (folder / "prior.ply").write_bytes(b"points")
        (tmp_path / name / "README.md").write_text(name)

    mark = mark_data(tmp_path / "here")
    assert mark == mark_data(tmp_path / "there")
    assert mark.motors == 2
    (tmp_path / "there" / "motor_1" / "prior.ply").write_bytes(b"more points")
    assert mark_data(tmp_path / "there").digest != mark.digest
    with pytest.raises(InputFileError, match="motor_"):
        mark_data(tmp_path)


@pytest.mark.parametrize("name", ["epochs", "learning_rate", "pretraining_clouds", "passes"])
def test_a_budget_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=f"{name} must be > 0, got 0"):
        replace(BUDGETS["quick"], **{name: 0})
