"""Small things of the study to test with, among them a trainer that only counts."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from boltpose.evaluation.study_plan import Run, folds_of, plan_run, plan_study
from boltpose.evaluation.study_records import (
    FORMAT,
    StudyEnvironment,
    StudyRecord,
    score_study,
    thin_losses,
)
from boltpose.evaluation.study_rows import BUDGETS, ROWS, StudyRow
from boltpose.evaluation.study_run import WEIGHTS_FILE, OnTraining, TestCounts, Trained
from boltpose.evaluation.study_settings import DataMark, RunSettings, TrainingSettings

FAMILIES = {f"motor_{number:03d}": f"family_{number % 6}" for number in range(18)}
DATA = DataMark(motors=18, digest="0123456789ab")
SYNTHETIC = DataMark(motors=240, digest="ba9876543210")
SCENES = DataMark(motors=80, digest="abcdefabcdef")
CLASSES = ("housing", "bolt")


def plan(*tables: str, only: tuple[str, ...] = (), budget: str = "quick") -> tuple[Run, ...]:
    return plan_study(
        tables,
        FAMILIES,
        BUDGETS[budget],
        data=DATA,
        synthetic=SYNTHETIC,
        scenes=SCENES,
        only=only,
    )


@dataclass(eq=False)
class CountingTrainer:
    """Three steps a training; what it gives follows from the settings alone."""

    steps: int = 3
    trained: list[str] = field(default_factory=list)
    """Folders in which a training began, in order."""
    before_step: Callable[[Path, int], None] = lambda out, step: None

    def train(
        self,
        settings: TrainingSettings,
        out: Path,
        *,
        pretrained: Path | None,
        on_step: OnTraining,
    ) -> Trained:
        weights, log = out / WEIGHTS_FILE, out / "log.json"
        out.mkdir(parents=True, exist_ok=True)
        losses = json.loads(log.read_text()) if log.exists() else []
        if not weights.exists():
            self.trained.append(out.name)
            start = 0.0 if pretrained is None else float(pretrained.read_text())
            for step in range(len(losses), self.steps):
                self.before_step(out, step)
                losses.append(1.0 / (1 + step + start))
                log.write_text(json.dumps(losses))
                on_step("training", step, self.steps, losses[-1])
            weights.write_text(str(start + settings.points / 1024))
        return Trained(weights=weights, losses=tuple(losses), parameters=1000)

    def score(self, settings: RunSettings, weights: Path) -> TestCounts:
        wrong = sum(map(ord, "".join(settings.test))) % 7 + round(float(weights.read_text()))
        return TestCounts(classes=CLASSES, confusion=((100, wrong), (wrong, 50)))

    def versions(self) -> Mapping[str, str]:
        return {"counting": "1"}


def record(row: StudyRow, fold: str, right: int, *, budget: str = "study") -> StudyRecord:
    """A run in which `right` of 100 points of every class are labelled rightly."""
    table = "honest" if fold.startswith("without-") else "table2"
    (found,) = (one for one in folds_of(table, FAMILIES) if one.name == fold)
    marks = {"data": DATA, "synthetic": SCENES if row.task == "scene" else SYNTHETIC}
    run = plan_run(row, found, BUDGETS[budget], **marks)
    confusion = ((right, 100 - right), (100 - right, right))
    return StudyRecord(
        format=FORMAT,
        run=run.name,
        fold=fold,
        settings=run.settings,
        classes=CLASSES,
        confusion=confusion,
        scores=score_study(confusion, CLASSES),
        parameters=1_400_000,
        steps=192,
        losses=thin_losses([1.0, 0.5]),
        cpu_s=600.0,
        pretraining_cpu_s=None if run.settings.pretraining is None else 3600.0,
        environment=StudyEnvironment(
            commit="abc123", machine="Linux, 2 cores", versions={"torch": "1"}
        ),
    )


def row(table: str, name: str) -> StudyRow:
    (found,) = (one for one in ROWS[table] if one.name == name)
    return found
