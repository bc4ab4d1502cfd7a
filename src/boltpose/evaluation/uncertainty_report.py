"""Are the stated uncertainties true? The section of `docs/results.md`, and its picture.

python -m boltpose.evaluation.uncertainty_report results docs/results.md
"""

from __future__ import annotations

import argparse
import io
import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np
from scipy.stats import chi2, norm

from boltpose.evaluation.tables import markdown_table
from boltpose.evaluation.uncertainty_run import (
    FOLDER,
    TOLERANCES_MM,
    UncertainBolt,
    UncertainMotor,
    read_uncertain_motors,
)
from boltpose.io.atomic import write_atomic
from boltpose.tool_fit import disc_probability

PICTURE = Path("images") / "uncertainty.png"
"""Relative to the report."""
EVEN_FAMILIES = frozenset({"direct_closed_2ear", "offset_reduction", "planetary_closed"})
"""They chose the sigmas; the others test them."""
LEVELS = (0.5, 0.68, 0.9, 0.95, 0.99)
STATED_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.01)
"""Edges; the last takes in what is certain."""

_HOW = """\
Simulated (reman18), networks that never saw the family, every view located once more by
`python -m boltpose.evaluation.uncertainty_run`. *Held*: share of the bolts whose truth lies in the
region that is stated with so much confidence: the ellipsoid of the covariance, a disc beside the
axis, a stretch along it, a cone about its direction. The constants (camera's scale error and
ripple, share of a prior's sigma, tilt of a bolt) follow from the even families; the odd ones test
them, with priors and poses of their own, though they had been seen when earlier constants were
chosen. A view's depth error is common to all its bolts, so that the number of independent errors is
nearer to that of the views than to that of the bolts: the last column is what chance alone does to
a true 95 % in so many views."""

_LIMITS = """\
More held than stated is caution, and there is some: the floors across the line of sight and of the
rotation are those of the factory's camera, which is worse than reman18's. `sigma_lateral_mm` in a
result is the sigma of the worse direction: a round region drawn with it holds more than the disc
of the table, which counts both. Along the line of sight the factory's camera errs by 0.19 mm at
700 mm, more than is stated by default (0.12): a real camera needs its own
`FineConfig.depth_scale_sigma`. Hand-eye matrices of the data set are exact; `--hand-eye-sigma`, or
residuals in the file, add theirs."""


def confidence_of(entry: UncertainBolt) -> tuple[float, float, float, float]:
    """Confidence, 0 to 1, of the smallest stated region that holds the truth.

    Uniformly distributed if the covariance and the sigmas are exact.

    Args:
        entry: A bolt and its true error.

    Returns:
        Of the ellipsoid of the position, the disc beside the axis, the stretch along it, and the
        cone about its direction.
    """
    bolt = entry.bolt
    wide, narrow = (max(sigma, 1e-6) for sigma in entry.sigmas_across_mm)
    axial = abs(bolt.error.axial_mm) / bolt.sigma_axial_mm
    # the length of two equal normal components is Rayleigh distributed
    tilt = bolt.error.axis_rad / bolt.sigma_axis_rad
    return (
        float(chi2.cdf(bolt.position_sigmas**2, 3)),
        disc_probability(wide, narrow, max(bolt.error.lateral_mm, 1e-9)),
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
        "The same by what was stated, bolts and tools together:",
        _stated_table(motors),
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
        confidence = np.array([confidence_of(entry) for entry in bolts])
        cells = [
            " / ".join(f"{100 * np.mean(confidence[:, column] <= level):.0f}" for level in LEVELS)
            for column in range(4)
        ]
        low, high = chance_band(0.95, views)
        rows.append(
            [name, str(len(bolts)), str(views), *cells, f"{100 * low:.0f} to {100 * high:.0f}"]
        )
    stated = " / ".join(f"{100 * level:.0f}" for level in LEVELS)
    header = [
        "bolts",
        "count",
        "views",
        f"position, held of {stated} %",
        "lateral",
        "axial",
        "axis",
    ]
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


def _stated_table(motors: Sequence[UncertainMotor]) -> str:
    """Stated probability in bins, against the share of bolts that each tool fits."""
    rows: list[list[str]] = []
    for name, bolts, _ in _groups(motors)[:2]:
        pairs = np.array(
            [
                (stated, entry.bolt.error.lateral_mm <= tolerance)
                for entry in bolts
                if entry.bolt.is_sure
                for stated, tolerance in zip(entry.tool_fits, TOLERANCES_MM, strict=True)
            ]
        ).reshape(-1, 2)
        cells: list[str] = []
        for low, high in pairwise(STATED_BINS):
            inside = pairs[(pairs[:, 0] >= low) & (pairs[:, 0] < high)]
            if not len(inside):
                cells.append("-")
                continue
            stated, held = 100 * inside.mean(axis=0)
            cells.append(f"{stated:.0f} / {held:.0f} of {len(inside)}")
        rows.append([name, *cells])
    bins = [f"{100 * low:.0f} to {100 * min(high, 1):.0f}" for low, high in pairwise(STATED_BINS)]
    return markdown_table(["stated / true, %", *bins], rows)


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
    figure = Figure(figsize=(13, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    stated = np.linspace(0.0, 1.0, 101)
    titles = ("position", "beside the axis", "along the axis", "axis direction")
    for column, title in enumerate(titles):
        axes = figure.add_subplot(1, len(titles), column + 1)
        for name, bolts, views in _groups(motors)[:2]:
            if not bolts:
                continue
            confidence = np.sort([confidence_of(entry)[column] for entry in bolts])
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
