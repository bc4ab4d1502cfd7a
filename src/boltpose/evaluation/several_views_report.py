"""What several views of one clamping are worth: the section of `docs/results.md`, and its picture.

python -m boltpose.evaluation.several_views_report results docs/results.md
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from boltpose.errors import MissingExtraError
from boltpose.evaluation.poses import POSITION_LIMIT
from boltpose.evaluation.several_views_cases import Kind
from boltpose.evaluation.several_views_run import (
    FOLDER,
    CaseRecord,
    ClampingRecord,
    read_clampings,
)
from boltpose.evaluation.statistics import share_of, spread_of
from boltpose.evaluation.tables import markdown_table
from boltpose.io.atomic import write_atomic
from boltpose.registration.joint import JointConfig

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PICTURE = Path("images") / "several_views.png"
"""Relative to the report."""

_HOW = """\
Simulated: fresh motors of the factory (a seed nothing was trained on), each in one clamp, seen by
one camera from four places 20 to 100 degrees apart; its scale error, bias, ripple and warp are the
same in all shots, so nothing is averaged away that a real camera would keep. Priors from the true
labels of the full scans; masks by the shipped scene network, trained on other motors of the same
factory, but true masks where the motor is hidden. One view is `locate`, more are `locate_views`.
Errors are those of the pose in `base`, also of refused ones."""


def sections(results: Path) -> list[str]:
    """Render what `results/several_views` holds, Markdown; nothing if it holds nothing."""
    motors = read_clampings(results / FOLDER)
    if not motors:
        return []
    return [
        "## Several views of one clamping",
        _HOW,
        f"{len(motors)} motors, {len({motor.family for motor in motors})} families.",
        _growth_table(motors),
        "*stated sigma*: median, along the first view's line of sight; *error / sigma*: root mean "
        "square there, 1 if what is stated comes true; *in 95 %*: true bolts in the stated 95 % "
        "ellipsoid of the pose. With more views, the error of the prior's own scan is left.",
        f"![Errors by number of views]({PICTURE.as_posix()})",
        "### Nine tenths of the motor hidden in every view",
        "Something straight-edged stands before the camera, from another side in each view.",
        _hidden_table(motors),
        "### Something is wrong with the last view",
        "Its camera pose is off, or the motor was moved between the shots (the clamp was not). No "
        "pose is right for all views then. *accepted, wrong*: a bolt more than 2 mm or 2 degrees "
        "off.",
        _refusal_table(motors),
        _threshold_sentence(motors),
    ]


def draw_several_views(results: Path, report: Path) -> bool:
    """Draw `images/several_views.png` beside the report; False where there are no records.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    motors = read_clampings(results / FOLDER)
    if not motors:
        return False
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "train") from error
    figure = Figure(figsize=(11, 4))
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    _draw_growth(left, motors)
    _draw_distances(right, motors)
    figure.tight_layout()
    buffer = io.BytesIO()
    # no date and no version in the file: the same numbers give the same bytes
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})

    def write(stream: BinaryIO) -> None:
        stream.write(buffer.getvalue())

    (report.parent / PICTURE).parent.mkdir(parents=True, exist_ok=True)
    write_atomic(report.parent / PICTURE, write)
    return True


def _pick(
    motors: Iterable[ClampingRecord], wanted: Callable[[CaseRecord], bool]
) -> list[CaseRecord]:
    return [case for motor in motors for case in motor.cases if wanted(case)]


def _counts(motors: Sequence[ClampingRecord], kind: Kind) -> list[int]:
    return sorted({len(case.views) for case in _pick(motors, lambda case: case.kind == kind)})


def _of(motors: Sequence[ClampingRecord], kind: Kind, count: int) -> list[CaseRecord]:
    return _pick(motors, lambda case: case.kind == kind and len(case.views) == count)


def _spread(values: Iterable[float | None]) -> str:
    spread = spread_of(abs(value) for value in values if value is not None)
    if spread is None:
        return "-"
    return f"{spread.median:.3f} / {spread.p95:.3f} / {spread.maximum:.3f}"


def _share(flags: Iterable[bool]) -> str:
    share = share_of(flags)
    return "-" if share is None else f"{100 * share:.0f} %"


def _growth_table(motors: Sequence[ClampingRecord]) -> str:
    rows: list[list[str]] = []
    for count in _counts(motors, Kind.AS_IS):
        cases = _of(motors, Kind.AS_IS, count)
        told = [case for case in cases if case.depth_mm is not None and case.depth_sigma_mm]
        ratios = [(case.depth_mm or 0.0) / (case.depth_sigma_mm or 1.0) for case in told]
        sigma = float(np.median([case.depth_sigma_mm or 0.0 for case in told]))
        rows.append(
            [
                str(count),
                f"{sum(case.is_ok for case in cases)} / {len(cases)}",
                _spread(case.worst_bolt_mm for case in cases),
                _spread(case.depth_mm for case in cases),
                f"{sigma:.3f}",
                f"{np.sqrt(np.mean(np.square(ratios))):.2f}",
                _share(s <= POSITION_LIMIT for case in cases for s in case.bolt_sigmas),
                str(sum(case.is_ok and case.is_wrong for case in cases)),
            ]
        )
    return markdown_table(
        [
            "views",
            "accepted",
            "worst bolt, mm (median / 95 % / max)",
            "along the first line of sight, mm",
            "stated sigma",
            "error / sigma",
            "in 95 %",
            "false accepts",
        ],
        rows,
    )


def _hidden_table(motors: Sequence[ClampingRecord]) -> str:
    rows = [
        [
            str(count),
            f"{sum(case.is_ok for case in cases)} / {len(cases)}",
            f"{sum(not case.is_wrong for case in cases)} / {len(cases)}",
            _spread(case.worst_bolt_mm for case in cases if case.is_ok),
            str(sum(case.is_ok and case.is_wrong for case in cases)),
        ]
        for count in _counts(motors, Kind.HIDDEN)
        for cases in [_of(motors, Kind.HIDDEN, count)]
    ]
    return markdown_table(
        ["views", "accepted", "pose right", "worst bolt of the accepted, mm", "false accepts"], rows
    )


def _refusal_table(motors: Sequence[ClampingRecord]) -> str:
    rows: list[list[str]] = []
    for kind in Kind:
        for count in _counts(motors, kind):
            cases = _of(motors, kind, count)
            if not cases[0].must_be_refused:
                continue
            apart = [case.views_apart_sigmas for case in cases if case.views_apart_sigmas]
            rows.append(
                [
                    str(kind),
                    str(count),
                    f"{sum(not case.is_ok for case in cases)} / {len(cases)}",
                    f"{sum('views_disagree' in case.failed for case in cases)}",
                    f"{min(apart):.1f}" if apart else "-",
                    _spread(case.worst_bolt_mm for case in cases if case.is_ok),
                    str(sum(case.is_ok and case.is_wrong for case in cases)),
                ]
            )
    return markdown_table(
        [
            "case",
            "views",
            "refused",
            "as `views_disagree`",
            "least distance, sigma",
            "worst bolt of the accepted, mm",
            "accepted, wrong",
        ],
        rows,
    )


def _threshold_sentence(motors: Sequence[ClampingRecord]) -> str:
    found = [
        case.views_apart_sigmas
        for case in _pick(motors, lambda case: case.kind == Kind.AS_IS)
        if case.views_apart_sigmas is not None
    ]
    return (
        f"Views of an untouched clamping are at most {max(found):.1f} sigma apart; from "
        f"{JointConfig().max_distance_sigmas:.0f} on they disagree. The limit was set when these "
        "motors were known: it has not been tested blindly."
    )


def _draw_growth(axes: Axes, motors: Sequence[ClampingRecord]) -> None:
    counts = _counts(motors, Kind.AS_IS)
    rng = np.random.default_rng(0)
    named: tuple[tuple[str, Callable[[CaseRecord], float | None], str, float], ...] = (
        ("worst bolt", lambda case: case.worst_bolt_mm, "tab:blue", -0.12),
        ("along the first line of sight", lambda case: case.depth_mm, "tab:orange", 0.12),
    )
    for name, number, color, aside in named:
        for row, count in enumerate(counts):
            values = [abs(number(case) or 0.0) for case in _of(motors, Kind.AS_IS, count)]
            place = count + aside + rng.uniform(-0.06, 0.06, len(values))
            axes.plot(place, values, ".", color=color, alpha=0.5, label=None if row else name)
            axes.plot(
                [count + aside - 0.1, count + aside + 0.1],
                [np.median(values)] * 2,
                color=color,
                linewidth=3,
            )
    axes.set(
        yscale="log",
        xticks=counts,
        xlabel="views of one clamping",
        ylabel="error, mm",
        ylim=(1e-3, None),
        title="more views, less depth bias (simulated)",
    )
    axes.legend(fontsize="small")


def _draw_distances(axes: Axes, motors: Sequence[ClampingRecord]) -> None:
    kinds = [kind for kind in Kind if kind is not Kind.HIDDEN]
    for row, kind in enumerate(kinds):
        found = [
            case.views_apart_sigmas
            for case in _pick(motors, lambda case, kind=kind: case.kind == kind)
            if case.views_apart_sigmas is not None
        ]
        axes.plot(found, [row] * len(found), "|", markersize=14, color=f"C{row}")
    axes.axvline(JointConfig().max_distance_sigmas, color="black", label="refused from here on")
    axes.set(
        xscale="log",
        yticks=range(len(kinds)),
        yticklabels=[str(kind) for kind in kinds],
        xlabel="distance of the two views that agree least, sigma",
        title="do the views agree? (simulated)",
    )
    axes.legend(fontsize="small")


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("report", type=Path)
    given = parser.parse_args(arguments)
    draw_several_views(given.results, given.report)


if __name__ == "__main__":
    main()
