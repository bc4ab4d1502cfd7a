"""The learning curve as a picture: scores on split 0 against the budget."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from boltpose.errors import ConfigError
from boltpose.evaluation.study_records import StudyRecord
from boltpose.evaluation.study_rows import CURVE_BACKBONES, CURVE_BUDGETS, CURVE_ROWS
from boltpose.evaluation.study_statistics import METRICS, records_of
from boltpose.io.atomic import write_atomic

FOLD = "split0"
_COLOURS = ("#1f6feb", "#d1621b")
_DASHES = ("-", "--", ":")
_NO_DATE: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Kinds of pictures, and what would make them differ from run to run."""


def draw_curve(records: Sequence[StudyRecord], path: Path) -> None:
    """Draw every score of every backbone of the curve against the budget.

    Args:
        records: Runs; those of the curve are picked.
        path: Picture to write: .png, .svg or .pdf.

    Raises:
        ConfigError: There is no run of the curve.
    """
    rows = dict(zip((row.name for row in CURVE_ROWS), CURVE_ROWS, strict=True))
    figure = Figure(figsize=(6.4, 4.8), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    is_empty = True
    for backbone, colour in zip(CURVE_BACKBONES, _COLOURS, strict=True):
        found = [
            (budget, run)
            for budget in CURVE_BUDGETS
            if (run := records_of(rows[f"{backbone} x{budget:g}"], records).get(FOLD)) is not None
        ]
        for (metric, value), dash in zip(METRICS.items(), _DASHES, strict=True):
            if found:
                is_empty = False
                axes.plot(
                    [budget for budget, _ in found],
                    [value(run) for _, run in found],
                    dash,
                    color=colour,
                    marker="o",
                    markersize=4,
                    label=f"{backbone}, {metric}",
                )
    if is_empty:
        raise ConfigError("there is no run of the learning curve: boltpose reproduce curve")
    axes.set_xscale("log", base=2)
    axes.set_xticks(CURVE_BUDGETS, [f"{budget:g}" for budget in CURVE_BUDGETS])
    axes.set_xlabel("times the budget of the study's runs")
    axes.set_ylabel("on two held-out motors (split 0, simulated), %")
    axes.grid(alpha=0.3)
    figure.legend(fontsize=8, loc="outside upper center", ncols=len(CURVE_BACKBONES))
    kind = path.suffix.lower().removeprefix(".")

    def write(stream: BinaryIO) -> None:
        # no date and no random ids: the same runs give the same file
        with matplotlib.rc_context({"svg.hashsalt": "boltpose"}):
            figure.savefig(stream, format=kind, metadata=_NO_DATE[kind])

    write_atomic(path, write)
