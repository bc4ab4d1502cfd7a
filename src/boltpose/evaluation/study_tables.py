"""The paper's study as Markdown: our numbers, the paper's beside them, and how they compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from boltpose.evaluation.codec import encode
from boltpose.evaluation.study_paper import EFFECTS, PAPER, PaperRow
from boltpose.evaluation.study_records import StudyRecord
from boltpose.evaluation.study_rows import (
    CURVE_BACKBONES,
    CURVE_BUDGETS,
    PUBLISHED_POINTS,
    ROWS,
    SMALL,
    TABLES,
    VIEWS,
)
from boltpose.evaluation.study_statistics import (
    METRICS,
    MeanSpread,
    PairOrder,
    compare_orders,
    kendall_tau,
    mean_spread,
    paired_difference,
    table_records,
)
from boltpose.evaluation.tables import markdown_table

COMMAND = "boltpose reproduce"

Runs = Mapping[str, Mapping[str, StudyRecord]]
"""By row and fold."""

_TITLES = {
    "table2": "Backbones (the paper's table 2)",
    "table3": "Points, pretraining, warm-up (the paper's table 3)",
    "binary": "Motor or not, in views (the paper's binary segmentation)",
    "curve": "Scores against the budget",
    "honest": "Backbones, leaving out one family",
}

_SMALL_TABLES = " and ".join(
    table
    for table in ("table2", "table3", "binary")
    if all(row.backbone == SMALL for row in ROWS[table])
)

_DIFFERENT = f"""\
Other than in the paper:

- **The data are simulated**: reman18 for training and test, motors of this package's factory for
  pretraining. Levels are not comparable with the paper's real motors; orders and effects may be.
- Networks see xyz in the motor's canonical frame, found without labels (views: levelled by their
  plate); the paper segments first and aligns the motor by the labels.
- The budget of a run is given below; it is the same for every row of a table. Epochs count points:
  a motor gives the same number of points per epoch at any size of sub-cloud, so 4096-point rows
  make half as many steps, as in the paper.
- Every row of {_SMALL_TABLES} runs `{SMALL}`, a PCT with 64 channels, 2 attention layers and no
  neighbour embedding: the published one is too slow on two cores, at 4096 points above all. The
  other tables run the published sizes.
- Test clouds are labelled whole, in random disjoint sub-clouds; scores pool the points of a
  split's test motors. Values are means over splits, +- is the standard deviation over splits."""


def render_study(
    records: Sequence[StudyRecord],
    *,
    tables: Sequence[str] = TABLES,
    picture: str = "",
    level: int = 3,
) -> str:
    """Write the study as Markdown, without a title of its own.

    Args:
        records: All runs.
        tables: Which tables; those without runs are left out.
        picture: Link to the picture of the learning curve; none if empty.
        level: Of the headings.

    Returns:
        Sections; empty if there is no run of these tables.
    """
    sections: list[str] = []
    used: dict[str, StudyRecord] = {}
    for table in tables:
        rows = table_records(table, records)
        if table == "curve":
            # the unit budget alone is a run of table 2 or 3, and no curve
            rows = rows if any(name not in _UNIT_ROWS for name in rows) else {}
        if not rows:
            continue
        used.update({run.run: run for runs in rows.values() for run in runs.values()})
        sections += ["#" * level + f" {_TITLES[table]}", *_SECTIONS[table](rows)]
        if table == "curve" and picture:
            sections.append(f"![Scores against the budget]({picture})")
    if not sections:
        return ""
    return "\n\n".join([_provenance(list(used.values())), _DIFFERENT, *sections])


def study_as_json(records: Sequence[StudyRecord], tables: Sequence[str] = TABLES) -> Any:
    """The tables' numbers as JSON-ready data: per table and row mean, spread and the paper's."""
    return {
        table: {
            name: {
                "folds": sorted(runs),
                **{
                    metric: encode(mean_spread([value(run) for run in runs.values()]))
                    for metric, value in METRICS.items()
                },
                "paper": encode(PAPER.get(table, {}).get(name)),
            }
            for name, runs in rows.items()
        }
        for table in tables
        if (rows := table_records(table, records))
    }


_UNIT_ROWS = frozenset(f"{backbone} x1" for backbone in CURVE_BACKBONES)


def _scores_table(table: str, rows: Runs) -> str:
    """One line per row: our means and spreads, the paper's numbers."""
    paper = PAPER[table]
    has_bolts = table != "binary"
    metrics = [name for name in METRICS if has_bolts or name != "bolt IoU"]
    lines: list[list[str]] = []
    for name, runs in rows.items():
        row = paper[name]
        line = [name, f"{_any(runs).parameters / 1e6:.2f} M", str(len(runs))]
        for metric in metrics:
            line += [_shown(_mean(runs, metric)), _paper_value(row, metric)]
        lines.append([*line, f"{_minutes(runs):.0f}"])
    header = ["row", "parameters", "splits"]
    for metric in metrics:
        header += [f"{metric}, %", "paper"]
    return markdown_table([*header, "CPU min per run"], lines)


def _table2(rows: Runs) -> list[str]:
    return [_scores_table("table2", rows), _order("table2", rows), _budget(rows)]


def _table3(rows: Runs) -> list[str]:
    lines: list[list[str]] = []
    for effect in EFFECTS:
        if effect.before not in rows or effect.after not in rows:
            continue
        line = [effect.name]
        for metric, value in METRICS.items():
            found = paired_difference(rows[effect.before], rows[effect.after], value)
            there = _paper_number(PAPER["table3"][effect.after], metric)
            was = _paper_number(PAPER["table3"][effect.before], metric)
            line += [_shown(found, sign=True), f"{there - was:+.2f}"]
        lines.append(line)
    header = ["change"]
    for metric in METRICS:
        header += [f"{metric}, points", "paper"]
    effects = (
        ["What each change does, split by split:", markdown_table(header, lines)] if lines else []
    )
    return [_scores_table("table3", rows), *effects, _order("table3", rows), _budget(rows)]


def _binary(rows: Runs) -> list[str]:
    return [_scores_table("binary", rows), _budget(rows)]


def _curve(rows: Runs) -> list[str]:
    lines: list[list[str]] = []
    for backbone in CURVE_BACKBONES:
        for budget in CURVE_BUDGETS:
            runs = {
                fold: run
                for fold, run in rows.get(f"{backbone} x{budget:g}", {}).items()
                if fold == "split0"
            }
            if not runs:
                continue
            clouds = _clouds(_any(runs))
            shown = [_shown(_mean(runs, metric)) for metric in METRICS]
            lines.append([backbone, f"{budget:g}", f"{clouds:.0f}", *shown])
    header = ["backbone", "times the budget", "sub-clouds", *(f"{name}, %" for name in METRICS)]
    return [
        "Split 0, pretrained, with warm-up:",
        markdown_table(header, lines),
        *_stable(rows),
    ]


def _stable(rows: Runs) -> list[str]:
    """Say at which budgets one backbone is above the other; nothing if only one was run."""
    shown: list[str] = []
    one, other = CURVE_BACKBONES
    for budget in CURVE_BUDGETS:
        first = rows.get(f"{one} x{budget:g}", {}).get("split0")
        second = rows.get(f"{other} x{budget:g}", {}).get("split0")
        if first is not None and second is not None:
            difference = METRICS["mIoU"](first) - METRICS["mIoU"](second)
            shown.append(f"{difference:+.1f} at {budget:g}")
    if not shown:
        return []
    return [f"mIoU of {one} less that of {other}: {', '.join(shown)} times the budget."]


def _honest(rows: Runs) -> list[str]:
    lines: list[list[str]] = []
    for name, runs in rows.items():
        worst = min(runs.values(), key=METRICS["mIoU"])
        family = worst.fold.removeprefix("without-")
        line = [name, str(len(runs)), *(_shown(_mean(runs, metric)) for metric in METRICS)]
        lines.append([*line, f"{METRICS['mIoU'](worst):.2f} ({family})"])
    header = ["row", "families", *(f"{name}, %" for name in METRICS), "worst family, mIoU"]
    return [
        "The test motors' family is never trained on; +- is the standard deviation over families. "
        "The paper has no such test.",
        markdown_table(header, lines),
        _budget(rows),
    ]


_SECTIONS = {
    "table2": _table2,
    "table3": _table3,
    "binary": _binary,
    "curve": _curve,
    "honest": _honest,
}


def _order(table: str, rows: Runs) -> str:
    """Compare the order of rows with the paper's, by every score."""
    said: list[str] = []
    against: list[PairOrder] = []
    for metric, value in METRICS.items():
        paper = {name: _paper_number(row, metric) for name, row in PAPER[table].items()}
        pairs = compare_orders(rows, paper, value)
        tau = kendall_tau(pairs)
        if tau is None:
            continue
        agreeing = sum(pair.is_as_in_paper for pair in pairs)
        said.append(f"{metric} {agreeing} of {len(pairs)} (Kendall's tau {tau:.2f})")
        if metric == "mIoU":
            against = [pair for pair in pairs if not pair.is_as_in_paper]
    if not said:
        return "One row alone has no order."
    lines = [f"Pairs of rows in the paper's order, by {'; '.join(said)}."]
    clear = [pair for pair in against if pair.is_beyond_spread]
    if clear:
        listed = "; ".join(
            f"{pair.lower} above {pair.higher} by {_shown(_negated(pair.difference))}"
            for pair in clear
        )
        lines.append(f"The other way round by mIoU, by more than the spread over splits: {listed}.")
    if len(clear) < len(against):
        lines.append(
            f"{len(against) - len(clear)} other pair(s) the other way round by mIoU are within the "
            "spread or have one split only."
        )
    return " ".join(lines)


def _provenance(records: Sequence[StudyRecord]) -> str:
    commits = sorted({record.environment.commit for record in records})
    machines = sorted({record.environment.machine for record in records})
    versions = sorted(
        {f"{name} {text}" for run in records for name, text in run.environment.versions.items()}
    )
    cpu_h = sum(record.cpu_s for record in records) / 3600
    before = {
        record.settings.pretraining: record.pretraining_cpu_s or 0.0
        for record in records
        if record.settings.pretraining is not None
    }
    before_h = sum(before.values()) / 3600
    return (
        f"**Simulated data.** Made by `{COMMAND}`: {len(records)} runs, {cpu_h:.1f} hours of one "
        f"core, and {before_h:.1f} for {len(before)} pretrainings that the splits share. "
        f"Commit {', '.join(commits)}; {', '.join(versions)}; {'; '.join(machines)}. One JSON "
        "file per run with settings, motors, confusion matrix and losses."
    )


def _budget(rows: Runs) -> str:
    """The settings that all runs share, read from them; what they do not share is said."""
    runs = [run for by_fold in rows.values() for run in by_fold.values()]
    shared = {
        (s.training.points_per_epoch, s.training.batch, s.training.learning_rate, s.training.data)
        for s in (run.settings for run in runs)
    }
    clouds = sorted(
        {round(_clouds(run)) for run in runs if run.settings.training.points == PUBLISHED_POINTS}
    )
    before = {
        round(p.epochs * p.data.motors * _scans(run) * p.points_per_epoch / p.points): p
        for run in runs
        if (p := run.settings.pretraining) is not None and p.points == PUBLISHED_POINTS
    }
    texts: list[str] = []
    if clouds:
        listed = ", ".join(map(str, clouds))
        texts.append(f"Budget of a run: {listed} sub-clouds of 2048 points")
    points, batch, rate, _ = next(iter(shared))
    texts.append(f"{points} points per scan and epoch, batch {batch}, learning rate {rate:g}")
    for count, settings in before.items():
        texts.append(
            f"pretraining on {count} sub-clouds of {settings.data.motors} synthetic motors"
        )
    text = "; ".join(texts) + "."
    if len(shared) > 1:
        text += " **The rows were run with different settings: not one budget.**"
    return text


def _scans(run: StudyRecord) -> int:
    """Scans that stand for a motor: its views in the scene task."""
    return VIEWS if run.settings.training.task == "scene" else 1


def _clouds(run: StudyRecord) -> float:
    """Sub-clouds a run learned from."""
    return float(run.steps * run.settings.training.batch)


def _any(runs: Mapping[str, StudyRecord]) -> StudyRecord:
    return next(iter(runs.values()))


def _mean(runs: Mapping[str, StudyRecord], metric: str) -> MeanSpread | None:
    return mean_spread([METRICS[metric](run) for run in runs.values()])


def _minutes(runs: Mapping[str, StudyRecord]) -> float:
    return sum(run.cpu_s for run in runs.values()) / len(runs) / 60


def _paper_number(row: PaperRow, metric: str) -> float:
    value = {
        "overall accuracy": row.overall_accuracy,
        "mIoU": row.mean_iou,
        "bolt IoU": row.bolt_iou,
    }[metric]
    if value is None:
        raise ValueError(f"the paper gives no {metric} here")
    return value


def _paper_value(row: PaperRow, metric: str) -> str:
    return f"{_paper_number(row, metric):.2f}"


def _negated(spread: MeanSpread) -> MeanSpread:
    return MeanSpread(count=spread.count, mean=-spread.mean, deviation=spread.deviation)


def _shown(spread: MeanSpread | None, *, sign: bool = False) -> str:
    if spread is None:
        return ""
    mean = f"{spread.mean:+.2f}" if sign else f"{spread.mean:.2f}"
    return mean if spread.deviation is None else f"{mean} +- {spread.deviation:.2f}"
