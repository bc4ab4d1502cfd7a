"""Joins the study of `boltpose.evaluation` to the trainings of `boltpose.training`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from boltpose.evaluation.study_run import OnTraining, TestCounts, Trained
from boltpose.evaluation.study_settings import RunSettings, TrainingSettings
from boltpose.training.plain import PlainConfig
from boltpose.training.study import (
    CLASS_NAMES,
    StudyData,
    package_versions,
    score_for_study,
    train_for_study,
)


class PlainTrainer:
    """Trains and scores as a run's settings say; a `Trainer`."""

    def __init__(self, data: Mapping[str, StudyData], *, workers: int = 1) -> None:
        """Take the data sets.

        Args:
            data: By the digest of their mark.
            workers: Processes that compute features.
        """
        self._data = data
        self._workers = workers

    def train(
        self,
        settings: TrainingSettings,
        out: Path,
        *,
        pretrained: Path | None,
        on_step: OnTraining,
    ) -> Trained:
        """Train into a run folder, or go on there; at once if it is finished."""
        config = PlainConfig(
            task=settings.task,
            backbone=settings.backbone,
            inputs=settings.inputs,
            points=settings.points,
            batch=settings.batch,
            epochs=settings.epochs,
            points_per_epoch=settings.points_per_epoch,
            warm_up_epochs=settings.warm_up_epochs,
            learning_rate=settings.learning_rate,
            use_bfloat16=settings.use_bfloat16,
            seed=settings.seed,
        )
        done = train_for_study(
            self._data[settings.data.digest],
            settings.motors,
            config,
            out,
            pretrained=pretrained,
            workers=self._workers,
            on_progress=on_step,
        )
        return Trained(weights=done.weights, losses=done.losses, parameters=done.parameters)

    def score(self, settings: RunSettings, weights: Path) -> TestCounts:
        """Label the test motors."""
        training = settings.training
        data = self._data[training.data.digest]
        return TestCounts(
            classes=CLASS_NAMES[training.task],
            confusion=score_for_study(data, settings.test, weights, settings.passes),
        )

    def versions(self) -> Mapping[str, str]:
        """Packages the numbers depend on."""
        return package_versions()
