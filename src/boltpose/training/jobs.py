"""What `boltpose train` does: from a data set and a recipe to a run folder with scores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from lightning_fabric import Fabric

from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.errors import ConfigError
from boltpose.segmentation.plain import INPUTS
from boltpose.segmentation.predictor import PARTS
from boltpose.training.hardware import Hardware
from boltpose.training.loop import FitConfig, Progress
from boltpose.training.parts import PartsConfig
from boltpose.training.plain import PlainConfig, score_plain, train_plain
from boltpose.training.runs import (
    EvidenceRun,
    train_part_models,
    train_scene_model,
    write_metrics,
)
from boltpose.training.scene import SceneConfig
from boltpose.training.scores import SegmentationScores, score_confusion

EVIDENCE = "evidence"
"""Inputs of the networks of the product: dense features and stage one's probabilities."""

RECIPES = ("few", "fine-tune", "many")
_EPOCH_POINTS = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainJob:
    """One training. Settings that are None are those of the recipe."""

    task: str
    """parts or scene."""
    out: Path
    """Run folder."""
    cache: Path
    """Folder for features of the data set; another data set needs another one."""
    test_cache: Path | None = None
    """The same for a data set that is only scored on."""
    inputs: str = EVIDENCE
    recipe: str = "few"
    """Of evidence networks: few or many motors; fine-tune: few, from pretrained weights."""
    backbone: str | None = None
    points: int | None = None
    batch: int | None = None
    epochs: float | None = None
    """Of 8192 points of every scan or view."""
    warm_up_epochs: float | None = None
    learning_rate: float | None = None
    seed: int = 0
    leave_out: str | None = None
    """Family not to learn from, to score on."""
    pretrained: Path | None = None
    """Run folder to start from."""
    workers: int = 1
    hardware: Hardware = field(default_factory=Hardware)

    def __post_init__(self) -> None:
        known = (EVIDENCE, *INPUTS)
        if self.inputs not in known:
            raise ConfigError(f"--inputs must be one of {', '.join(known)}, got {self.inputs}")
        if self.recipe not in RECIPES:
            raise ConfigError(f"--recipe must be one of {', '.join(RECIPES)}, got {self.recipe}")
        if self.inputs == EVIDENCE and self.backbone not in (None, "pct-small"):
            raise ConfigError(
                f"--backbone {self.backbone} reads points: choose --inputs {', '.join(INPUTS)}; "
                "networks of dense evidence are pct-small"
            )


def run_job(
    data: LabelledMotors,
    job: TrainJob,
    *,
    test: LabelledMotors | None = None,
    on_progress: Progress = lambda what, step, steps, loss: None,
) -> SegmentationScores | None:
    """Train; an interrupted run goes on where it stopped, a finished one is scored anew.

    Args:
        data: The labelled motors.
        job: What to do.
        test: Another data set to score on, all of it.
        on_progress: Told every step.

    Returns:
        Scores on what was held out; None if nothing was, or in all processes but the first.

    Raises:
        ConfigError: A setting is out of its range, or the folder holds another run.
        InputFileError: The pretrained weights cannot be used.
    """
    if test is not None and job.leave_out is not None:
        raise ConfigError(f"--test and --leave-out {job.leave_out} exclude each other")
    if (test is None) != (job.test_cache is None):
        raise ConfigError("a data set to score on and its test_cache belong together")
    if job.leave_out is not None:
        data.motors_of(job.leave_out)
    fabric = job.hardware.launch()
    if job.inputs != EVIDENCE:
        return _run_plain(data, job, fabric, test, on_progress)
    run = EvidenceRun(
        data=data,
        leave_out=job.leave_out,
        cache=job.cache,
        out=job.out,
        test=test,
        pretrained=job.pretrained,
        fabric=fabric,
        workers=job.workers,
        on_progress=on_progress,
    )
    if job.task == "parts":
        return train_part_models(run, _parts_recipe(job, data))
    return train_scene_model(run, _scene_recipe(job, data))


def _run_plain(
    data: LabelledMotors,
    job: TrainJob,
    fabric: Fabric,
    test: LabelledMotors | None,
    on_progress: Progress,
) -> SegmentationScores | None:
    motors = tuple(m for m in data.motors if data.family(m) != job.leave_out)
    config = plain_config(job)
    weights = train_plain(
        data,
        motors,
        config,
        job.out,
        cache=job.cache,
        pretrained=job.pretrained,
        fabric=fabric,
        workers=job.workers,
        on_progress=on_progress,
    )
    if not fabric.is_global_zero or (test is None and job.leave_out is None):
        return None
    if test is not None and job.test_cache is not None:
        confusion = score_plain(test, test.motors, weights, cache=job.test_cache)
    else:
        held_out = tuple(m for m in data.motors if m not in motors)
        confusion = score_plain(data, held_out, weights, cache=job.cache)
    names = [p.name.lower() for p in PARTS] if job.task == "parts" else ["background", "motor"]
    scores = score_confusion(confusion, names)
    write_metrics(job.out, job.task, scores, asdict(config))
    return scores


def plain_config(job: TrainJob) -> PlainConfig:
    """The recipe of a network that reads points."""
    base = PlainConfig(task=job.task, inputs=job.inputs, seed=job.seed)
    epochs = base.epochs if job.epochs is None else job.epochs
    return replace(
        base,
        backbone=job.backbone or base.backbone,
        points=base.points if job.points is None else job.points,
        batch=base.batch if job.batch is None else job.batch,
        epochs=epochs,
        warm_up_epochs=min(base.warm_up_epochs, epochs)
        if job.warm_up_epochs is None
        else job.warm_up_epochs,
        learning_rate=base.learning_rate if job.learning_rate is None else job.learning_rate,
    )


def _parts_recipe(job: TrainJob, data: LabelledMotors) -> PartsConfig:
    makers: dict[str, Callable[[], PartsConfig]] = {
        "few": PartsConfig,
        "fine-tune": PartsConfig.for_fine_tuning,
        "many": PartsConfig.for_many_motors,
    }
    recipe = makers[job.recipe]()
    points = recipe.sub_cloud if job.points is None else job.points
    scans = len(data.motors) * recipe.clouds.copies
    return replace(
        recipe,
        sub_cloud=points,
        pool=max(recipe.pool, points),
        fit=_fit_config(job, recipe.fit, scans, points),
        seed=job.seed,
    )


def _scene_recipe(job: TrainJob, data: LabelledMotors) -> SceneConfig:
    makers: dict[str, Callable[[], SceneConfig]] = {
        "few": SceneConfig,
        "fine-tune": SceneConfig.for_fine_tuning,
        "many": SceneConfig.for_many_motors,
    }
    recipe = makers[job.recipe]()
    points = recipe.sub_cloud if job.points is None else job.points
    views = sum(data.view_count(motor) for motor in data.motors)
    return replace(
        recipe, sub_cloud=points, fit=_fit_config(job, recipe.fit, views, points), seed=job.seed
    )


def _fit_config(job: TrainJob, fit: FitConfig, scans: int, points: int) -> FitConfig:
    """The recipe's loop with what the job says otherwise."""
    batch = fit.batch if job.batch is None else job.batch
    per_epoch = scans * _EPOCH_POINTS / (points * batch)
    steps = fit.steps if job.epochs is None else max(1, round(job.epochs * per_epoch))
    share = fit.warmup_share
    if job.warm_up_epochs is not None:
        share = job.warm_up_epochs * per_epoch / steps
        if share > 1:
            raise ConfigError(
                f"--warm-up must be at most the run's {steps / per_epoch:.3g} epochs, "
                f"got {job.warm_up_epochs}"
            )
    return replace(
        fit,
        steps=steps,
        batch=batch,
        warmup_share=share,
        learning_rate=fit.learning_rate if job.learning_rate is None else job.learning_rate,
        seed=job.seed,
    )
