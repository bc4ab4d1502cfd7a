"""Draw what many priors cost, and how far the right one is ahead.

python -m boltpose.evaluation.variants_picture results docs/results.md
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

from boltpose.evaluation.variants_records import VariantMotor, read_variant_motors
from boltpose.evaluation.variants_report import PICTURE, agreement_of, group_cases
from boltpose.io.atomic import write_atomic


def draw_variants(results: Path, report: Path) -> bool:
    """Draw `images/variants.png` beside the report; returns False where nothing was measured."""
    motors = read_variant_motors(results / "variants")
    if not motors:
        return False
    figure = Figure(figsize=(11, 4.2))
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    _draw_time(left, motors)
    _draw_agreement(right, motors)
    figure.tight_layout()
    buffer = io.BytesIO()
    # no date and no version in the file: the same numbers give the same bytes
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})

    def write(stream: BinaryIO) -> None:
        stream.write(buffer.getvalue())

    (report.parent / PICTURE).parent.mkdir(parents=True, exist_ok=True)
    write_atomic(report.parent / PICTURE, write)
    return True


def _draw_time(axes: Axes, motors: Sequence[VariantMotor]) -> None:
    groups = group_cases(motors)
    one = [case.one_prior_cpu_s for motor in motors for case in motor.cases]
    for is_known, label in ((True, "clamped motor known"), (False, "its prior left out")):
        sizes = [priors for known, priors in groups if known is is_known]
        cpu_s = [[case.cpu_s for _, case in groups[is_known, size]] for size in sizes]
        low, middle, high = np.array([np.percentile(part, [5, 50, 95]) for part in cpu_s]).T
        axes.plot(sizes, middle, marker="o", label=label)
        axes.fill_between(sizes, low, high, alpha=0.2)
    axes.axhline(float(np.median(one)), color="black", linestyle=":", label="one prior, given")
    axes.set(
        xlabel="priors in the folder",
        ylabel="CPU s per view, median and 5-95 %",
        title="cost of not knowing the motor (simulated)",
        xlim=(0, None),
        ylim=(0, None),
    )
    axes.legend(fontsize="small")


def _draw_agreement(axes: Axes, motors: Sequence[VariantMotor]) -> None:
    pairs = [
        (case.is_known, *agreement_of(motor, case)) for motor in motors for case in motor.cases
    ]
    bins = list(np.linspace(0.0, 1.0, 51))
    axes.hist([own for _, own, _ in pairs if own is not None], bins=bins, label="right motor")
    for is_known, label in ((True, "best other motor"), (False, "best motor, right one left out")):
        others = [other for known, _, other in pairs if known is is_known and other is not None]
        axes.hist(others, bins=bins, alpha=0.7, label=label)
    axes.set(
        xlabel="agreement of the motor points (within 0.5 mm)",
        ylabel="cases",
        title="right motor and look-alikes (simulated)",
    )
    axes.legend(fontsize="small")


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("report", type=Path)
    given = parser.parse_args(arguments)
    draw_variants(given.results, given.report)


if __name__ == "__main__":
    main()
