"""What the study runs, as plain data: budgets, splits, the rows of every table, single runs."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from boltpose.errors import ConfigError, InputFileError
from boltpose.evaluation.codec import encode

SPLITS = 5
TEST_MOTORS = 2
SPLIT_SEED = 0
VIEWS = 4
"""Views of a motor, in reman18 and in the synthetic scenes: together they count as one scan."""
PUBLISHED_POINTS = 2048
"""Points of a sub-cloud in the paper's best row."""

TABLES = ("table2", "table3", "binary", "curve", "honest")
"""In the order in which `all` runs them: the paper's first, the largest last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What every run of the study may spend; one for all rows.

    It counts points, as epochs do: of a motor, `points_per_epoch` points go by in an epoch, in
    sub-clouds of whatever size. So 4096-point sub-clouds make half as many steps, as in the paper.
    """

    name: str
    epochs: float
    warm_up_epochs: float
    points_per_epoch: int
    """Per full scan; the views of a motor together count as one scan."""
    learning_rate: float
    batch: int = 4
    use_bfloat16: bool = True
    pretraining_clouds: int
    """Sub-clouds of 2048 points, whatever the number of synthetic motors; half as many of 4096."""
    pretraining_warm_up: float = 1 / 16
    """Share of the pretraining."""
    passes: int = 1
    """Times every test cloud is run through whole, in other sub-clouds; votes are added."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("epochs", "points_per_epoch", "learning_rate", "pretraining_clouds", "passes"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be > 0, got {getattr(self, name)}")


BUDGETS: Mapping[str, Budget] = {
    # 16 motors x 12 epochs x 4 sub-clouds of 2048 points: 768 clouds, 192 steps
    "study": Budget(
        name="study",
        epochs=12,
        warm_up_epochs=1,
        points_per_epoch=8192,
        learning_rate=1e-3,
        pretraining_clouds=1536,
    ),
    # does everything once, says nothing
    "quick": Budget(
        name="quick",
        epochs=1,
        warm_up_epochs=0.25,
        points_per_epoch=4096,
        learning_rate=1e-3,
        pretraining_clouds=16,
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyRow:
    """One line of a table: a way to train."""

    name: str
    backbone: str
    points: int = PUBLISHED_POINTS
    task: str = "parts"
    is_pretrained: bool = True
    has_warm_up: bool = True
    epochs: float = 1.0
    """Relative to the budget's."""

    @property
    def cost(self) -> float:
        """Rough time of a run relative to PointNet's at 2048 points; only orders the runs.

        Per point, from clouds per second in FINDINGS section 2; attention and neighbour search
        grow with the square of the points.
        """
        per_point = {"pointnet": 1.0, "pointnet2": 1.0, "dgcnn": 1.7, "pct-small": 1.5, "pct": 4.0}
        quadratic = (
            self.points / PUBLISHED_POINTS
            if self.backbone not in ("pointnet", "pointnet2")
            else 1.0
        )
        return per_point.get(self.backbone, 4.0) * quadratic * self.epochs


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """Which motors are trained on and which are tested."""

    name: str
    train: tuple[str, ...]
    test: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DataMark:
    """Which data set it is, wherever it lies."""

    motors: int
    digest: str
    """12 hexadecimal digits over names and sizes of all files of motors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """All that one training follows from, besides the code."""

    task: str
    backbone: str
    inputs: str
    points: int
    batch: int
    epochs: float
    warm_up_epochs: float
    points_per_epoch: int
    learning_rate: float
    use_bfloat16: bool
    seed: int
    data: DataMark
    motors: tuple[str, ...] | None
    """Trained on; None for all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """All that one run of the study follows from."""

    training: TrainingSettings
    pretraining: TrainingSettings | None
    test: tuple[str, ...]
    passes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run: a row on a fold. Two tables that share a row share its runs."""

    name: str
    """Tells runs of one budget apart; file name of its record."""
    fold: str
    settings: RunSettings
    cost: float


TABLE2_ROWS = tuple(
    StudyRow(name=name, backbone=name) for name in ("pointnet", "pointnet2", "dgcnn", "pct")
)
SMALL = "pct-small"
"""Backbone of all of table 3: the published PCT at 4096 points is too slow on two cores."""
TABLE3_ROWS = (
    StudyRow(name="2048", backbone=SMALL, is_pretrained=False, has_warm_up=False),
    StudyRow(name="2048 warm-up", backbone=SMALL, is_pretrained=False),
    StudyRow(name="2048 pretrain", backbone=SMALL, has_warm_up=False),
    StudyRow(name="2048 pretrain warm-up", backbone=SMALL),
    StudyRow(name="1024 pretrain warm-up", backbone=SMALL, points=1024),
    StudyRow(name="4096 pretrain warm-up", backbone=SMALL, points=4096),
    StudyRow(name="4096 pretrain warm-up x2", backbone=SMALL, points=4096, epochs=2.0),
)
BINARY_ROWS = (StudyRow(name="binary", backbone=SMALL, task="scene"),)
CURVE_BACKBONES = ("pct-small", "pointnet2")
CURVE_BUDGETS = (0.25, 0.5, 1.0, 2.0)
CURVE_ROWS = tuple(
    StudyRow(name=f"{backbone} x{epochs:g}", backbone=backbone, epochs=epochs)
    for backbone in CURVE_BACKBONES
    for epochs in CURVE_BUDGETS
)
ROWS: Mapping[str, tuple[StudyRow, ...]] = {
    "table2": TABLE2_ROWS,
    "table3": TABLE3_ROWS,
    "binary": BINARY_ROWS,
    "curve": CURVE_ROWS,
    "honest": TABLE2_ROWS,
}

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


def mark_data(root: Path) -> DataMark:
    """Recognise a data set by the names and sizes of its motors' files.

    Raises:
        InputFileError: There is no motor in the folder.
    """
    files = sorted(path for path in root.glob("motor_*/**/*") if path.is_file())
    if not files:
        raise InputFileError(root, "no motor_*/ with files", "a folder of labelled motors")
    digest = hashlib.sha256()
    for path in files:
        digest.update(f"{path.relative_to(root).as_posix()} {path.stat().st_size}\0".encode())
    motors = len({path.relative_to(root).parts[0] for path in files})
    return DataMark(motors=motors, digest=digest.hexdigest()[:12])


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


def digest_of(settings: TrainingSettings | RunSettings) -> str:
    """8 hexadecimal digits that differ when settings differ; names folders of networks."""
    text = json.dumps(encode(settings), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:8]
