"""The numbers of the paper's study, beside which ours are shown. Per cent, means of 5 splits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperRow:
    """One row of a table of the paper."""

    overall_accuracy: float
    mean_iou: float
    bolt_iou: float | None = None
    """None where the paper gives none."""


PAPER: Mapping[str, Mapping[str, PaperRow]] = {
    "table2": {
        "pointnet": PaperRow(overall_accuracy=66.82, mean_iou=59.63, bolt_iou=26.10),
        "pointnet2": PaperRow(overall_accuracy=80.64, mean_iou=72.13, bolt_iou=48.16),
        "dgcnn": PaperRow(overall_accuracy=84.57, mean_iou=75.07, bolt_iou=48.04),
        "pct": PaperRow(overall_accuracy=90.47, mean_iou=84.58, bolt_iou=64.92),
    },
    "table3": {
        "2048": PaperRow(overall_accuracy=79.35, mean_iou=72.80, bolt_iou=44.35),
        "2048 warm-up": PaperRow(overall_accuracy=83.02, mean_iou=76.07, bolt_iou=44.80),
        "2048 pretrain": PaperRow(overall_accuracy=87.58, mean_iou=81.12, bolt_iou=59.45),
        "2048 pretrain warm-up": PaperRow(overall_accuracy=90.47, mean_iou=84.58, bolt_iou=64.92),
        "1024 pretrain warm-up": PaperRow(overall_accuracy=86.21, mean_iou=79.58, bolt_iou=53.85),
        "4096 pretrain warm-up": PaperRow(overall_accuracy=71.89, mean_iou=61.33, bolt_iou=33.20),
        "4096 pretrain warm-up x2": PaperRow(
            overall_accuracy=83.49, mean_iou=76.72, bolt_iou=55.43
        ),
    },
    "binary": {"binary": PaperRow(overall_accuracy=99.80, mean_iou=99.07)},
}
"""Table, row, numbers; rows as in `study_rows.ROWS`. Source: the paper's tables `backbone` and
`supper_parameter` and the paragraph on binary segmentation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """A change of one setting: what the second of two rows does otherwise."""

    name: str
    before: str
    after: str


EFFECTS = (
    Effect(name="pretraining, without warm-up", before="2048", after="2048 pretrain"),
    Effect(name="pretraining, with warm-up", before="2048 warm-up", after="2048 pretrain warm-up"),
    Effect(name="warm-up, from scratch", before="2048", after="2048 warm-up"),
    Effect(name="warm-up, pretrained", before="2048 pretrain", after="2048 pretrain warm-up"),
    Effect(
        name="1024 instead of 2048 points",
        before="2048 pretrain warm-up",
        after="1024 pretrain warm-up",
    ),
    Effect(
        name="4096 instead of 2048 points",
        before="2048 pretrain warm-up",
        after="4096 pretrain warm-up",
    ),
    Effect(
        name="epochs doubled at 4096 points",
        before="4096 pretrain warm-up",
        after="4096 pretrain warm-up x2",
    ),
)
"""What table 3 is about."""
