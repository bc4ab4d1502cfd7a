"""Do the runs of the study that are not done yet, alone or beside other processes."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from boltpose.errors import ConfigError
from boltpose.evaluation.codec import encode
from boltpose.evaluation.fingerprint import describe_environment
from boltpose.evaluation.study_claims import claim, claimant
from boltpose.evaluation.study_clock import CpuClock, read_cpu_s
from boltpose.evaluation.study_plan import Run
from boltpose.evaluation.study_records import (
    FORMAT,
    StudyEnvironment,
    StudyRecord,
    read_study_record,
    record_path,
    score_study,
    thin_losses,
    write_study_record,
)
from boltpose.evaluation.study_settings import RunSettings, TrainingSettings, digest_of

WEIGHTS_FILE = "weights.safetensors"
"""Stands in a run folder once its training is finished."""
POLL_S = 5.0

OnTraining = Callable[[str, int, int, float], None]
"""Called with what is being done, the step, from 0, the number of steps and the loss."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """A finished training."""

    weights: Path
    losses: tuple[float, ...]
    """Of every step, from the first, also those of earlier attempts."""
    parameters: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TestCounts:
    """A network's labels of the test motors."""

    classes: tuple[str, ...]
    confusion: tuple[tuple[int, ...], ...]
    """Points by true class (row) and given class (column)."""


class Trainer(Protocol):
    """What trains and scores; `boltpose.training.study` does it, tests put a stand-in here."""

    def train(
        self,
        settings: TrainingSettings,
        out: Path,
        *,
        pretrained: Path | None,
        on_step: OnTraining,
    ) -> Trained:
        """Train into a run folder, or go on there; at once if it is finished."""
        ...

    def score(self, settings: RunSettings, weights: Path) -> TestCounts:
        """Label the test motors."""
        ...

    def versions(self) -> Mapping[str, str]:
        """Packages the numbers depend on."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEvents:
    """What is told while the study runs; every one may be left out."""

    on_step: OnTraining = lambda what, step, steps, loss: None
    """What is trained, step, steps, loss."""
    on_run: Callable[[StudyRecord, bool], None] = lambda record, is_new: None
    """A run is done; whether this process did it."""
    on_wait: Callable[[str], None] = lambda who: None
    """All that is left is under way in other processes."""
    wait: Callable[[float], None] = time.sleep
    """Waits so many seconds for other processes."""


def run_study(
    runs: Sequence[Run],
    trainer: Trainer,
    *,
    out: Path,
    work: Path,
    redo: bool = False,
    events: StudyEvents | None = None,
) -> tuple[StudyRecord, ...]:
    """Do all runs that have no record yet, in order; other processes may do the same at once.

    Every run's record is written as soon as the run is done. A process that is ended loses what it
    did since the last checkpoint of the run at hand, nothing else.

    Args:
        runs: What is to be there in the end.
        trainer: Trains and scores.
        out: Folder of the records; made if missing.
        work: Folder of networks and checkpoints; made if missing.
        redo: Run again what was run with other settings.
        events: What is told meanwhile.

    Returns:
        The records, in the order of `runs`.

    Raises:
        ConfigError: A record was made with other settings and `redo` is off; nothing is run.
        InputFileError: A record cannot be read.
    """
    tell = events or StudyEvents()
    done: dict[str, StudyRecord] = {}
    if not redo:
        for run in runs:
            check_settings(run, out)
    out.mkdir(parents=True, exist_ok=True)
    work.mkdir(parents=True, exist_ok=True)
    worker = _Worker(trainer, out, work, tell)
    while len(done) < len({run.name for run in runs}):
        blocked_by = ""
        for run in runs:
            if run.name in done:
                continue
            record = worker.attempt(run)
            if record is not None:
                done[run.name] = record
                break
            blocked_by = blocked_by or worker.blocked_by
        else:
            tell.on_wait(blocked_by)
            tell.wait(POLL_S)
    return tuple(done[run.name] for run in runs)


def check_settings(run: Run, out: Path) -> None:
    """Refuse a record that was made with other settings than a run has.

    Raises:
        ConfigError: The text names the first setting that differs.
        InputFileError: The record cannot be read.
    """
    path = record_path(out, run.name)
    if not path.exists():
        return
    there = read_study_record(path).settings
    if there != run.settings:
        raise ConfigError(
            f"{path} was made with other settings ({_first_difference(there, run.settings)}): "
            "--redo runs it again, another --out keeps it"
        )


class _Worker:
    """One process's share of the study."""

    def __init__(self, trainer: Trainer, out: Path, work: Path, tell: StudyEvents) -> None:
        self._trainer = trainer
        self._out = out
        self._work = work
        self._tell = tell
        # asked before the first run: the code that runs is the code that was there at the start
        self._environment = StudyEnvironment(
            commit=describe_environment().commit,
            machine=_machine(),
            versions={"python": platform.python_version(), **trainer.versions()},
        )
        self.blocked_by = ""
        """Who did what the last attempt could not have."""

    def attempt(self, run: Run) -> StudyRecord | None:
        """Return the record of a run that is done, or do it; None if another process is at it."""
        record = self._finished(run)
        if record is not None:
            self._tell.on_run(record, False)
            return record
        pretrained: Path | None = None
        if run.settings.pretraining is not None:
            pretrained = self._pretrain(run.settings.pretraining)
            if pretrained is None:
                return None
        claim_path = self._work / f"{run.name}.claim"
        with claim(claim_path) as is_mine:
            if not is_mine:
                self.blocked_by = claimant(claim_path)
                return None
            record = self._finished(run)  # it may have been finished before the claim was granted
            if record is None:
                record = self._do(run, pretrained)
                write_study_record(self._out, record)
                self._tell.on_run(record, True)
            else:
                self._tell.on_run(record, False)
        return record

    def _finished(self, run: Run) -> StudyRecord | None:
        path = record_path(self._out, run.name)
        if not path.exists():
            return None
        record = read_study_record(path)
        return record if record.settings == run.settings else None

    def _pretrain(self, settings: TrainingSettings) -> Path | None:
        """Return weights of a pretraining, made if missing; None while another process is at it."""
        folder = self._pretraining_folder(settings)
        weights = folder / WEIGHTS_FILE
        if weights.exists():
            return weights
        claim_path = folder.with_name(f"{folder.name}.claim")
        with claim(claim_path) as is_mine:
            if not is_mine:
                self.blocked_by = claimant(claim_path)
                return None
            return self._train(settings, folder, None).weights

    def _pretraining_folder(self, settings: TrainingSettings) -> Path:
        name = f"pretrain_{settings.task}_{settings.backbone}_{settings.points}"
        return self._work / f"{name}_{digest_of(settings)}"

    def _train(self, settings: TrainingSettings, folder: Path, pretrained: Path | None) -> Trained:
        # the time is kept beside the folder: what is in the folder is the training's business
        with CpuClock(_clock_path(folder)) as clock:

            def on_step(what: str, step: int, steps: int, loss: float) -> None:
                clock.tick()
                self._tell.on_step(f"{folder.name.rsplit('_', 1)[0]}, {what}", step, steps, loss)

            return self._trainer.train(settings, folder, pretrained=pretrained, on_step=on_step)

    def _do(self, run: Run, pretrained: Path | None) -> StudyRecord:
        settings = run.settings
        folder = self._work / f"{run.name}_{digest_of(settings)}"
        trained = self._train(settings.training, folder, pretrained)
        with CpuClock(_clock_path(folder)):
            counts = self._trainer.score(settings, trained.weights)
        pretraining_cpu_s = None
        if settings.pretraining is not None:
            pretraining_cpu_s = read_cpu_s(
                _clock_path(self._pretraining_folder(settings.pretraining))
            )
        return StudyRecord(
            format=FORMAT,
            run=run.name,
            fold=run.fold,
            settings=settings,
            classes=counts.classes,
            confusion=counts.confusion,
            scores=score_study(counts.confusion, counts.classes),
            parameters=trained.parameters,
            steps=len(trained.losses),
            losses=thin_losses(trained.losses),
            cpu_s=round(read_cpu_s(_clock_path(folder)), 1),
            pretraining_cpu_s=None if pretraining_cpu_s is None else round(pretraining_cpu_s, 1),
            environment=self._environment,
        )


def _clock_path(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.cpu_s")


def _machine() -> str:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    model = next((line.split(":", 1)[1].strip() for line in lines if "model name" in line), "")
    return ", ".join(
        part
        for part in (f"{platform.system()} {platform.machine()}", model, f"{cores} cores")
        if part
    )


def _first_difference(there: RunSettings, now: RunSettings) -> str:
    """Say for example `training.epochs: 2.0 there, 15.0 now`."""

    def flat(prefix: str, value: object) -> dict[str, object]:
        if isinstance(value, dict):
            return {
                key: leaf
                for name, inner in value.items()
                for key, leaf in flat(f"{prefix}.{name}" if prefix else str(name), inner).items()
            }
        return {prefix: value}

    old, new = flat("", encode(there)), flat("", encode(now))
    for name in [*new, *old]:
        if old.get(name) != new.get(name):
            return f"{name}: {old.get(name)} there, {new.get(name)} now"
    return "none that can be named"
