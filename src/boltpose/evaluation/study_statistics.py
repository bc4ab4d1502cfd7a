"""Means, spreads and orders over the splits of the study. Everything in per cent."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from boltpose.evaluation.study_plan import run_name
from boltpose.evaluation.study_records import StudyRecord
from boltpose.evaluation.study_rows import ROWS, StudyRow

BOLT = "bolt"

Metric = Callable[[StudyRecord], float]
"""A score of a run, per cent."""

METRICS: Mapping[str, Metric] = {
    "overall accuracy": lambda record: 100 * record.scores.overall_accuracy,
    "mIoU": lambda record: 100 * record.scores.mean_iou,
    "bolt IoU": lambda record: 100 * record.scores.iou.get(BOLT, 0.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanSpread:
    """Numbers of several splits in three."""

    count: int
    mean: float
    deviation: float | None
    """Standard deviation over the splits (n - 1); None for one split."""


def mean_spread(values: Sequence[float]) -> MeanSpread | None:
    """Summarise numbers; None if there are none."""
    if not values:
        return None
    deviation = statistics.stdev(values) if len(values) > 1 else None
    return MeanSpread(count=len(values), mean=statistics.fmean(values), deviation=deviation)


def records_of(
    row: StudyRow, records: Sequence[StudyRecord], *, by_family: bool = False
) -> dict[str, StudyRecord]:
    """A row's runs by fold; the splits', or those that leave out a family."""
    return {
        record.fold: record
        for record in records
        if record.run == run_name(row, record.fold)
        and record.fold.startswith("without-") == by_family
    }


def table_records(table: str, records: Sequence[StudyRecord]) -> dict[str, dict[str, StudyRecord]]:
    """Runs of a table by row and fold; rows without runs are left out."""
    found = {row.name: records_of(row, records, by_family=table == "honest") for row in ROWS[table]}
    return {name: runs for name, runs in found.items() if runs}


def paired_difference(
    before: Mapping[str, StudyRecord], after: Mapping[str, StudyRecord], metric: Metric
) -> MeanSpread | None:
    """How much higher the second of two rows scores, split by split; None without common splits."""
    common = sorted(set(before) & set(after))
    return mean_spread([metric(after[fold]) - metric(before[fold]) for fold in common])


@dataclass(frozen=True, slots=True, kw_only=True)
class PairOrder:
    """Two rows, the better one in the paper second, on the splits both have."""

    lower: str
    higher: str
    difference: MeanSpread
    """How much higher `higher` scores here."""

    @property
    def is_as_in_paper(self) -> bool:
        """Whether the order is the paper's."""
        return self.difference.mean > 0

    @property
    def is_beyond_spread(self) -> bool:
        """Whether the difference is larger than its standard deviation over the splits."""
        deviation = self.difference.deviation
        return deviation is not None and abs(self.difference.mean) > deviation


def compare_orders(
    rows: Mapping[str, Mapping[str, StudyRecord]], paper: Mapping[str, float], metric: Metric
) -> tuple[PairOrder, ...]:
    """Compare the order of all pairs of rows with that of the paper's values.

    Args:
        rows: Runs by row and fold.
        paper: The paper's value of every row.
        metric: What is compared.

    Returns:
        One entry per pair of rows that have a common split and differ in the paper.
    """
    pairs: list[PairOrder] = []
    for one, other in itertools.combinations([name for name in rows if name in paper], 2):
        lower, higher = sorted((one, other), key=lambda name: paper[name])
        difference = paired_difference(rows[lower], rows[higher], metric)
        if difference is not None and paper[lower] < paper[higher]:
            pairs.append(PairOrder(lower=lower, higher=higher, difference=difference))
    return tuple(pairs)


def kendall_tau(pairs: Sequence[PairOrder]) -> float | None:
    """Kendall's rank correlation: 1 for the paper's order, -1 for its reverse; None for no pair.

    Source: Kendall, Biometrika 30, 1938; ties count as neither.
    """
    if not pairs:
        return None
    signs = [(pair.difference.mean > 0) - (pair.difference.mean < 0) for pair in pairs]
    return sum(signs) / len(signs)
