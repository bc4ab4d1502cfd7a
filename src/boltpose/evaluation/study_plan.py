"""Which runs the study consists of: rows on folds of motors, in the order of work."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from boltpose.errors import ConfigError
from boltpose.evaluation.study_rows import PUBLISHED_POINTS, ROWS, TABLES, VIEWS, Budget, StudyRow
from boltpose.evaluation.study_settings import DataMark, RunSettings, TrainingSettings

SPLITS = 5
TEST_MOTORS = 2
SPLIT_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """Which motors are trained on and which are tested."""

    name: str
    train: tuple[str, ...]
    test: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run: a row on a fold. Two tables that share a row share its runs."""

    name: str
    """Tells runs of one budget apart; file name of its record."""
    fold: str
    settings: RunSettings
    cost: float


_STAGE = {"table2": 0, "table3": 0, "binary": 0, "curve": 1, "honest": 2}


def draw_splits(
    families: Mapping[str, str], *, splits: int = SPLITS, seed: int = SPLIT_SEED
) -> tuple[Fold, ...]:
    """Draw which motors are tested: two of two families per split, no motor in two splits.

    Families are tested as often as each other, as far as that goes.
    The order is that of SHA-256 of seed and name, so that it is the same on every machine and
    with every version of every library.

    Args:
        families: Family of every motor.
        splits: How many.
        seed: Another seed, other splits.

    Raises:
        ConfigError: There are not enough motors or families.
    """
    waiting = sorted(
        families, key=lambda motor: hashlib.sha256(f"{seed} {motor}".encode()).hexdigest()
    )
    if len(families) <= TEST_MOTORS:
        raise ConfigError(f"no split can be drawn from {len(families)} motors")
    tested: Counter[str] = Counter()
    folds: list[Fold] = []
    for number in range(splits):
        test: list[str] = []
        for _ in range(TEST_MOTORS):
            taken = {families[motor] for motor in test}
            free = [motor for motor in waiting if families[motor] not in taken]
            if not free:
                raise ConfigError(
                    f"{splits} splits with {TEST_MOTORS} test motors of different families cannot "
                    f"be drawn from {len(families)} motors of {len(set(families.values()))} "
                    "families"
                )
            # `min` takes the first of equals: of the families tested least, the motor drawn first
            motor = min(free, key=lambda motor: tested[families[motor]])
            tested[families[motor]] += 1
            waiting.remove(motor)
            test.append(motor)
        train = tuple(sorted(set(families) - set(test)))
        folds.append(Fold(name=f"split{number}", train=train, test=tuple(sorted(test))))
    return tuple(folds)


def leave_family_out(families: Mapping[str, str]) -> tuple[Fold, ...]:
    """One fold per family, all its motors tested: the honest test."""
    return tuple(
        Fold(
            name=f"without-{family}",
            train=tuple(sorted(motor for motor in families if families[motor] != family)),
            test=tuple(sorted(motor for motor in families if families[motor] == family)),
        )
        for family in sorted(set(families.values()))
    )


def plan_run(
    row: StudyRow, fold: Fold, budget: Budget, *, data: DataMark, synthetic: DataMark | None
) -> Run:
    """Say what a row does on a fold.

    Args:
        row: The way to train.
        fold: The motors.
        budget: What it may spend.
        data: The data set the motors are of.
        synthetic: Data set for pretraining.

    Raises:
        ConfigError: The row is pretrained and there is no synthetic data set.
    """

    def training(
        mark: DataMark, motors: tuple[str, ...] | None, epochs: float, warm_up: float
    ) -> TrainingSettings:
        return TrainingSettings(
            task=row.task,
            backbone=row.backbone,
            inputs="xyz",
            points=row.points,
            batch=budget.batch,
            epochs=float(epochs),
            warm_up_epochs=float(warm_up),
            points_per_epoch=budget.points_per_epoch // (VIEWS if row.task == "scene" else 1),
            learning_rate=budget.learning_rate,
            use_bfloat16=budget.use_bfloat16,
            seed=budget.seed,
            data=mark,
            motors=motors,
        )

    if row.is_pretrained and synthetic is None:
        option, kind = (
            ("--synthetic-scenes", "scenes") if row.task == "scene" else ("--synthetic", "motors")
        )
        raise ConfigError(
            f"row '{row.name}' is pretrained: {option} must name a data set of "
            f"`boltpose synth {kind}`"
        )
    pretraining = None
    if row.is_pretrained and synthetic is not None:
        points = budget.pretraining_clouds * PUBLISHED_POINTS
        epochs = points / (synthetic.motors * budget.points_per_epoch)
        pretraining = training(synthetic, None, epochs, epochs * budget.pretraining_warm_up)
    settings = RunSettings(
        training=training(
            data,
            fold.train,
            budget.epochs * row.epochs,
            budget.warm_up_epochs if row.has_warm_up else 0.0,
        ),
        pretraining=pretraining,
        test=fold.test,
        passes=budget.passes,
    )
    return Run(name=run_name(row, fold.name), fold=fold.name, settings=settings, cost=row.cost)


def run_name(row: StudyRow, fold: str) -> str:
    """Name of a row's run on a fold: rows of two tables that train the same share it."""
    parts = (
        "scene" if row.task == "scene" else "",
        row.backbone,
        str(row.points),
        "" if row.is_pretrained else "scratch",
        "" if row.has_warm_up else "cold",
        "" if row.epochs == 1 else f"x{row.epochs:g}",
        fold,
    )
    return "_".join(part for part in parts if part)


def folds_of(table: str, families: Mapping[str, str]) -> tuple[Fold, ...]:
    """Folds of a table: five splits, all families for `honest`, the first split for `curve`."""
    if table == "honest":
        return leave_family_out(families)
    return draw_splits(families)[: 1 if table == "curve" else None]


def plan_study(
    tables: Sequence[str],
    families: Mapping[str, str],
    budget: Budget,
    *,
    data: DataMark,
    synthetic: DataMark | None,
    scenes: DataMark | None,
    only: Sequence[str] = (),
) -> tuple[Run, ...]:
    """All runs of some tables: fold by fold, within a fold the cheapest first.

    So a table that is not complete has every row on the same folds, up to one. The paper's tables
    go before the curve, and that before leaving families out. No run is there twice.

    Args:
        tables: Of `TABLES`.
        families: Family of every motor of the data set.
        budget: For every run.
        data: The data set.
        synthetic: For pretraining on full scans.
        scenes: For pretraining on views.
        only: Rows; all if empty.

    Raises:
        ConfigError: No such table or row, too few motors, or no data set for pretraining.
    """
    for table in tables:
        if table not in ROWS:
            raise ConfigError(f"table must be one of {', '.join(TABLES)}, got '{table}'")
    known = {row.name for table in tables for row in ROWS[table]}
    unknown = [name for name in only if name not in known]
    if unknown:
        listed = ", ".join(f"'{name}'" for name in sorted(known))
        raise ConfigError(f"row must be one of {listed}, got '{unknown[0]}'")
    ordered = {
        (_STAGE[table], number, row.cost, run_name(row, fold.name)): (row, fold)
        for table in tables
        for number, fold in enumerate(folds_of(table, families))
        for row in ROWS[table]
        if not only or row.name in only
    }
    runs: dict[str, Run] = {}
    for key in sorted(ordered):
        row, fold = ordered[key]
        source = scenes if row.task == "scene" else synthetic
        run = plan_run(row, fold, budget, data=data, synthetic=source)
        runs.setdefault(run.name, run)
    return tuple(runs.values())
