"""The sections of the report that rest on `calibration.json` and on every `priors.json`."""

from __future__ import annotations

from pathlib import Path

from boltpose.evaluation.calibration_tables import (
    draw_calibration,
    read_calibration,
    render_calibration,
)
from boltpose.evaluation.prior_tables import name_priors, render_priors
from boltpose.evaluation.priors import read_priors

PICTURE = Path("images") / "calibration.png"
"""Relative to the report."""


def report_calibration(results: Path, report: Path) -> tuple[str, str]:
    """Render what is known, and draw the picture beside the report.

    Args:
        results: Folder that may hold `calibration.json` and, at any depth, `priors.json`.
        report: Path of the report; its folder gets `images/calibration.png`.

    Returns:
        The sections on the priors alone and on calibration, Markdown, each empty where nothing
        was measured.

    Raises:
        InputFileError: A file of these is damaged.
    """
    records = [read_priors(path) for path in sorted(results.glob("**/priors.json"))]
    path = results / "calibration.json"
    calibration = read_calibration(path) if path.exists() else None
    named = {name_priors(record): record for record in records}
    if calibration is not None or named:
        (report.parent / PICTURE).parent.mkdir(parents=True, exist_ok=True)
        draw_calibration(report.parent / PICTURE, calibration, named)
    text = render_calibration(calibration, named, picture=PICTURE.as_posix())
    return render_priors(records), text
