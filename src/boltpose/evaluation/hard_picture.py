"""Draw the ROC of the verdict.

python -m boltpose.evaluation.hard_picture results docs/results.md
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from boltpose.evaluation.hard_fit import is_judged
from boltpose.evaluation.hard_records import read_hard_motors
from boltpose.evaluation.hard_report import PICTURE, JudgedCases, error_rates, judge_cases
from boltpose.io.atomic import write_atomic
from boltpose.registration.config import VerifyConfig
from boltpose.registration.probability import features
from boltpose.registration.probability_config import FEATURES


def draw_verdict(results: Path, report: Path) -> bool:
    """Draw `images/verdict_roc.png` beside the report; returns False where there are no cases."""
    motors = read_hard_motors(results / "verdict")
    if not motors:
        return False
    judged = judge_cases(motors)
    judged = judged.pick(np.array([is_judged(case) for case in judged.cases], dtype=np.bool_))
    figure = Figure(figsize=(11, 4.2))
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    _draw_rates(left, judged.pick(~judged.is_chooser))
    _draw_histogram(right, judged)
    figure.tight_layout()
    buffer = io.BytesIO()
    # no date and no version in the file: the same numbers give the same bytes
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})

    def write(stream: BinaryIO) -> None:
        stream.write(buffer.getvalue())

    (report.parent / PICTURE).parent.mkdir(parents=True, exist_ok=True)
    write_atomic(report.parent / PICTURE, write)
    return True


def _draw_rates(axes: Axes, test: JudgedCases) -> None:
    floor = 0.3 / max(int(test.is_wrong.sum()), 1)
    table = np.array([features(case.evidence) for case in test.cases if case.evidence is not None])
    curves = [(name, table[:, column]) for column, name in enumerate(FEATURES)]
    for name, scores in [*curves, ("p_correct", test.p_correct)]:
        accepted, refused = error_rates(scores, test.is_good)
        axes.step(
            np.maximum(accepted, floor),
            np.maximum(refused, 3e-4),
            where="post",
            label=name,
            linewidth=2.5 if name == "p_correct" else 1.2,
            color="black" if name == "p_correct" else None,
        )
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="wrong poses accepted (share; left edge: none)",
        ylabel="good poses refused (share)",
        title="each number alone, odd families (simulated)",
    )
    axes.legend(fontsize="x-small", loc="upper right")


def _draw_histogram(axes: Axes, judged: JudgedCases) -> None:
    score = np.clip(judged.p_correct, 1e-4, 1 - 1e-4)
    logit = np.log10(score / (1 - score))
    bins = np.linspace(-4.0, 4.0, 61)
    for name, chosen in (("wrong", judged.is_wrong), ("good", judged.is_good)):
        axes.hist(logit[chosen], bins=list(bins), label=name, alpha=0.7)
    limit = VerifyConfig().min_p_correct
    axes.axvline(float(np.log10(limit / (1 - limit))), color="black", label="threshold")
    axes.set(
        yscale="log",
        xlabel="log10 of the odds p / (1 - p)",
        ylabel="cases",
        title="p_correct of all cases (simulated)",
    )
    axes.legend(fontsize="small")


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("report", type=Path)
    given = parser.parse_args(arguments)
    draw_verdict(given.results, given.report)


if __name__ == "__main__":
    main()
