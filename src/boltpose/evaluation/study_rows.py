"""What the study compares, as plain data: budgets, and the rows of every table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from boltpose.errors import ConfigError

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
