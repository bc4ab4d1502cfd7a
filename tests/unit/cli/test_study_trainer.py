"""The study on real trainings, of seconds, on toy motors."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from boltpose.cli.study_trainer import PlainTrainer
from boltpose.errors import ConfigError
from boltpose.evaluation.study_plan import Fold, Run, plan_run
from boltpose.evaluation.study_records import read_study_record, record_path
from boltpose.evaluation.study_rows import BUDGETS, Budget, StudyRow
from boltpose.evaluation.study_run import StudyEvents, run_study
from boltpose.evaluation.study_settings import DataMark, TrainingSettings
from boltpose.training.plain import PlainConfig, load_plain
from boltpose.training.study import StudyData
from tests.support.toy_data_set import ToyDataSet

DATA = ToyDataSet()
MARK = DataMark(motors=2, digest="toy")
FOLD = Fold(name="split0", train=("toy_0",), test=("toy_1",))
BUDGET = Budget(
    name="toy",
    epochs=1,
    warm_up_epochs=0.25,
    points_per_epoch=1024,
    learning_rate=3e-3,
    use_bfloat16=False,
    pretraining_clouds=1,
)


def _run(**changed: object) -> Run:
    row = StudyRow(name="toy", backbone="pct-small", points=128)
    return plan_run(replace(row, **changed), FOLD, BUDGET, data=MARK, synthetic=MARK)


@pytest.fixture(scope="module")
def trainer(tmp_path_factory: pytest.TempPathFactory) -> PlainTrainer:
    cache = tmp_path_factory.mktemp("features")
    return PlainTrainer({MARK.digest: StudyData(motors=DATA, cache=cache)})


def test_settings_are_the_recipe_that_is_trained(trainer: PlainTrainer, tmp_path: Path) -> None:
    settings = _run(has_warm_up=False).settings.training

    trained = trainer.train(
        settings, tmp_path, pretrained=None, on_step=lambda what, step, steps, loss: None
    )

    network, config = load_plain(trained.weights)
    shared = {f.name for f in fields(TrainingSettings)} - {"data", "motors"}
    assert {name: getattr(config, name) for name in shared} == {
        name: getattr(settings, name) for name in shared
    }
    # what the study does not set is what `boltpose train` does by default
    assert replace(config, **{name: getattr(PlainConfig(), name) for name in shared}) == (
        PlainConfig()
    )
    assert len(trained.losses) == config.steps(scans=1) == 2
    assert trained.parameters == sum(value.numel() for value in network.parameters())


def test_a_study_of_real_networks_goes_on_to_the_same_numbers(
    trainer: PlainTrainer, tmp_path: Path
) -> None:
    runs = (_run(), _run(is_pretrained=False))

    def interrupt(what: str, step: int, steps: int, loss: float) -> None:
        if what == "pct-small_128_split0, features":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(
            runs,
            trainer,
            out=tmp_path / "out",
            work=tmp_path / "work",
            events=StudyEvents(on_step=interrupt),
        )
    again = run_study(runs, trainer, out=tmp_path / "out", work=tmp_path / "work")
    whole = run_study(runs, trainer, out=tmp_path / "whole", work=tmp_path / "work_whole")

    assert [(one.confusion, one.losses) for one in again] == [
        (one.confusion, one.losses) for one in whole
    ]
    for one in again:
        assert np.sum(one.confusion) == len(DATA.full_scan("toy_1").labels)
        assert one.classes[-1] == "bolt"
        assert {"boltpose", "numpy", "torch"} <= set(one.environment.versions)
        assert read_study_record(record_path(tmp_path / "out", one.run)) == one
    assert again[0].confusion != again[1].confusion, "pretraining changes the network"


def test_a_motor_that_is_not_there_is_refused(trainer: PlainTrainer, tmp_path: Path) -> None:
    settings = replace(_run().settings.training, motors=("toy_0", "toy_99"))
    with pytest.raises(ConfigError, match="has no toy_99"):
        trainer.train(
            settings, tmp_path, pretrained=None, on_step=lambda what, step, steps, loss: None
        )


def test_the_budgets_fit_the_recipe() -> None:
    for budget in BUDGETS.values():
        assert budget.warm_up_epochs <= 0.25 * budget.epochs, "the curve's smallest budget"
