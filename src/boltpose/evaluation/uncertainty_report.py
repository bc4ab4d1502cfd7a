"""Are the stated uncertainties true? The section of `docs/results.md`, and its picture.

python -m boltpose.evaluation.uncertainty_report results docs/results.md
"""

from __future__ import annotations

import argparse
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from scipy.stats import norm

from boltpose.evaluation.poses import LocatedBoltRecord
from boltpose.evaluation.tables import markdown_table
from boltpose.evaluation.uncertainty_run import (
    FOLDER,
    TOLERANCES_MM,
    UncertainBolt,
    UncertainMotor,
    read_uncertain_motors,
)
from boltpose.io.atomic import write_atomic

PICTURE = Path("images") / "uncertainty.png"
"""Relative to the report."""
EVEN_FAMILIES = frozenset({"direct_closed_2ear", "offset_reduction", "planetary_closed"})
"""They chose the sigmas; the others test them."""
LEVELS = (0.5, 0.68, 0.9, 0.95, 0.99)

_HOW = """\
Simulated (reman18), networks that never saw the family, every view located once more by
`python -m boltpose.evaluation.uncertainty_run`. *Held*: share of the bolts whose truth lies in the
region that is stated with so much confidence: a disc beside the axis, a stretch along it, a cone
about its direction. The constants (camera's scale error and ripple, share of a prior's sigma, tilt
of a bolt) follow from the even families; the odd ones test them, with priors and poses of their
own, though they had been seen when earlier constants were chosen. A view's depth error is common
to all its bolts, so that the number of independent errors is nearer to that of the views than to
that of the bolts: the last column is what chance alone does to a true 95 % in so many views."""

_LIMITS = """\
The sigma beside the axis is that of the worse of two directions, and the floors across the line of
sight and of the rotation are those of the factory's camera, which is worse than reman18's: both
make for caution. Along the line of sight the factory's camera errs by 0.19 mm at 700 mm, more than
is stated by default (0.12): a real camera needs its own `FineConfig.depth_scale_sigma`."""


def confidence_of(bolt: LocatedBoltRecord) -> tuple[float, float, float]:
    """Confidence of the smallest stated region that holds the truth: lateral, axial, axis; 0 to 1.

    Uniformly distributed if the sigmas are exact. Beside the axis and for its direction the length
    of two normal components is Rayleigh distributed.
    """
    lateral = bolt.error.lateral_mm / bolt.sigma_lateral_mm
    axial = abs(bolt.error.axial_mm) / bolt.sigma_axial_mm
    tilt = bolt.error.axis_rad / bolt.sigma_axis_rad
    return (
        -math.expm1(-0.5 * lateral**2),
        math.erf(axial / math.sqrt(2.0)),
        -math.expm1(-0.5 * tilt**2),
    )


def sections(results: Path) -> list[str]:
    """Render what `results/uncertainty` holds, Markdown; nothing if it holds nothing."""
    motors = read_uncertain_motors(results / FOLDER)
    if not motors:
        return []
    return [
        "## Is the uncertainty true?",
        _HOW,
        _held_table(motors),
        f"![Stated confidence against held share]({PICTURE.as_posix()})",
        "### Does the tool fit?",
        "`p_tool_fits` of the sure bolts, taken that they are bolts, against the share whose true "
        "axis is that near:",
        _tool_table(motors),
        _LIMITS,
    ]


def _groups(
    motors: Sequence[UncertainMotor],
) -> list[tuple[str, list[UncertainBolt], int]]:
    """Name, bolts and number of views of every group that is told apart."""

    def pick(
        is_even: bool | None, wanted: Callable[[UncertainBolt], bool]
    ) -> tuple[list[UncertainBolt], int]:
        bolts: list[UncertainBolt] = []
        views = 0
        for motor in motors:
            if is_even is None or (motor.family in EVEN_FAMILIES) is is_even:
                chosen = [bolt for bolt in motor.bolts if wanted(bolt)]
                bolts += chosen
                views += len({bolt.view for bolt in chosen})
        return bolts, views

    kinds: list[tuple[str, bool | None, Callable[[UncertainBolt], bool]]] = [
        ("even families (chose)", True, lambda _: True),
        ("odd families (test)", False, lambda _: True),
        ("odd, visible", False, lambda entry: entry.bolt.is_truly_visible),
        ("odd, hidden", False, lambda entry: not entry.bolt.is_truly_visible),
    ]
    return [(name, *pick(is_even, wanted)) for name, is_even, wanted in kinds]


def _held_table(motors: Sequence[UncertainMotor]) -> str:
    rows: list[list[str]] = []
    for name, bolts, views in _groups(motors):
        if not bolts:
            continue
        confidence = np.array([confidence_of(entry.bolt) for entry in bolts])
        cells = [
            " / ".join(f"{100 * np.mean(confidence[:, column] <= level):.0f}" for level in LEVELS)
            for column in range(3)
        ]
        low, high = chance_band(0.95, views)
        rows.append(
            [name, str(len(bolts)), str(views), *cells, f"{100 * low:.0f} to {100 * high:.0f}"]
        )
    stated = " / ".join(f"{100 * level:.0f}" for level in LEVELS)
    header = ["bolts", "count", "views", f"lateral, held of {stated} %", "axial", "axis"]
    return markdown_table([*header, "chance at 95 %"], rows)


def _tool_table(motors: Sequence[UncertainMotor]) -> str:
    rows: list[list[str]] = []
    for name, bolts, _ in _groups(motors)[:2]:
        sure = [entry for entry in bolts if entry.bolt.is_sure]
        if not sure:
            continue
        cells: list[str] = []
        for column, tolerance in enumerate(TOLERANCES_MM):
            stated = np.mean([entry.tool_fits[column] for entry in sure])
            fits = np.mean([entry.bolt.error.lateral_mm <= tolerance for entry in sure])
            cells.append(f"{100 * stated:.0f} / {100 * fits:.0f}")
        rows.append([name, *cells])
    header = ["stated / true, %", *(f"{tolerance:g} mm" for tolerance in TOLERANCES_MM)]
    return markdown_table(header, rows)


def chance_band(share: float, draws: int) -> tuple[float, float]:
    """Where 95 % of all observed shares lie if each of so many draws holds with a probability."""
    half = float(norm.ppf(0.975)) * math.sqrt(share * (1.0 - share) / max(draws, 1))
    return max(0.0, share - half), min(1.0, share + half)


def draw_uncertainty(results: Path, report: Path) -> bool:
    """Draw `images/uncertainty.png` beside the report; returns False where there is no record."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    motors = read_uncertain_motors(results / FOLDER)
    if not motors:
        return False
    figure = Figure(figsize=(11, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    stated = np.linspace(0.0, 1.0, 101)
    for column, title in enumerate(("beside the axis", "along the axis", "axis direction")):
        axes = figure.add_subplot(1, 3, column + 1)
        for name, bolts, views in _groups(motors)[:2]:
            if not bolts:
                continue
            confidence = np.sort([confidence_of(entry.bolt)[column] for entry in bolts])
            held = np.searchsorted(confidence, stated, side="right") / len(confidence)
            axes.plot(stated, held, label=f"{name}, {views} views")
        draws = max(views for _, _, views in _groups(motors)[:2])
        band = np.array([chance_band(float(level), draws) for level in stated])
        axes.fill_between(stated, band[:, 0], band[:, 1], color="0.85", label="chance")
        axes.plot([0, 1], [0, 1], color="0.4", linewidth=0.8)
        axes.set(title=title, xlabel="stated confidence", ylabel="share held")
        axes.set(xlim=(0, 1), ylim=(0, 1))
    figure.axes[0].legend(loc="lower right", fontsize=8)
    buffer = io.BytesIO()
    # no date and no version in the file: the same numbers give the same bytes
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})

    def write(stream: BinaryIO) -> None:
        stream.write(buffer.getvalue())

    (report.parent / PICTURE).parent.mkdir(parents=True, exist_ok=True)
    write_atomic(report.parent / PICTURE, write)
    return True


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the picture from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("report", type=Path)
    given = parser.parse_args(arguments)
    draw_uncertainty(given.results, given.report)


if __name__ == "__main__":
    main()
