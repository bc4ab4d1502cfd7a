"""`results/calibration.json` and the bolts' confidences as Markdown and as a picture."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from boltpose.errors import InputFileError
from boltpose.evaluation.codec import decode
from boltpose.evaluation.priors import RIGHT_MM, PriorsRecord, confidence_reliability
from boltpose.evaluation.tables import markdown_table
from boltpose.io.atomic import write_atomic
from boltpose.segmentation.reliability import (
    BINS,
    CALIBRATION_FORMAT,
    CalibrationRecord,
    Reliability,
)

_MIN_COUNT = 20
"""Bins of fewer statements are left out of the picture: their share is noise."""


def read_calibration(path: str | Path) -> CalibrationRecord:
    """Read what `python -m boltpose.training calibrate` wrote.

    Raises:
        InputFileError: The file is missing or holds something else.
    """
    try:
        record = decode(CalibrationRecord, json.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InputFileError(path, str(error), "a record of `calibrate`") from error
    if record.format != CALIBRATION_FORMAT:
        raise InputFileError(path, f"format {record.format}", CALIBRATION_FORMAT)
    return record


def render_calibration(
    calibration: CalibrationRecord | None,
    priors: Mapping[str, PriorsRecord],
    *,
    picture: str = "",
) -> str:
    """Write the section on calibration.

    Args:
        calibration: Of the networks' classes; None if it was not measured.
        priors: By name, records whose bolts state a confidence.
        picture: Path of the reliability plot as the report links to it; empty for none.

    Returns:
        Markdown; empty if there is nothing to tell.
    """
    parts: list[str] = []
    if calibration is not None:
        parts += [
            "Do the probabilities mean what they say? Expected calibration error (ECE): how far, "
            f"on average over all points and {BINS} bins, the stated probability is from the share "
            "that came true; Brier score: mean square of probability minus truth. Every family is "
            "labelled by networks that have not seen it, and scaled by the temperature fitted on "
            "the *other* families.",
            _class_table(calibration),
            "Temperatures by family left out: "
            + "; ".join(
                f"`{network.network}` "
                + ", ".join(f"{value:.2f}" for value in network.temperatures.values())
                + f" (shipped {network.temperature:.2f})"
                for network in calibration.networks
            )
            + ".",
        ]
    confidences = {
        name: reliability
        for name, record in priors.items()
        if (reliability := confidence_reliability(record)) is not None
    }
    if confidences:
        parts += [
            "A bolt's `confidence` is the probability that it is a bolt, on its right side and at "
            f"most {RIGHT_MM:g} mm beside its true axis. It was fitted on motors of the factory "
            "(`boltpose.prior.confidence`), never on these:",
            _confidence_table(confidences),
        ]
    if parts and picture:
        parts.append(f"![Reliability of class probabilities and bolt confidences]({picture})")
    return "\n\n".join(parts)


def draw_calibration(
    path: str | Path,
    calibration: CalibrationRecord | None,
    priors: Mapping[str, PriorsRecord],
) -> None:
    """Draw reliability before and after the temperature, and of the bolts' confidence, as PNG.

    Raises:
        OSError: The folder is missing or not writable.
    """
    curves = (
        []
        if calibration is None
        else [
            (network.network.removesuffix(".onnx"), curve)
            for network in calibration.networks
            for curve in network.curves
        ]
    )
    panels = len(curves) + bool(priors)
    figure = Figure(figsize=(3.2 * max(panels, 1), 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    for number, (network, curve) in enumerate(curves, start=1):
        axes = _panel(figure, panels, number, f"{network}: {curve.statement}")
        _draw(axes, curve.before, f"before, ECE {100 * curve.before.expected_error:.2f} %")
        _draw(axes, curve.after, f"after, ECE {100 * curve.after.expected_error:.2f} %")
        axes.legend(fontsize="small")
    if priors:
        axes = _panel(figure, panels, panels, "confidence of bolts")
        for name, record in priors.items():
            if (reliability := confidence_reliability(record)) is not None:
                _draw_counts(axes, reliability, name)
        axes.legend(fontsize="small")
    buffer = io.BytesIO()
    # no date and no version in the file: the same numbers give the same bytes
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})

    def write(stream: BinaryIO) -> None:
        stream.write(buffer.getvalue())

    write_atomic(Path(path), write)


def _panel(figure: Figure, panels: int, number: int, title: str) -> Axes:
    axes = figure.add_subplot(1, panels, number)
    axes.plot((0, 1), (0, 1), color="0.7", linewidth=1)
    axes.set(xlabel="stated", ylabel="came true", xlim=(0, 1), ylim=(0, 1))
    axes.set_title(title, fontsize="medium")
    return axes


def _draw_counts(axes: Axes, reliability: Reliability, label: str) -> None:
    """Dots as large as their bin is full: most bins hold one bolt, which proves little."""
    shown = [entry for entry in reliability.bins if entry.count]
    axes.scatter(
        [entry.mean_probability for entry in shown],
        [entry.share_true for entry in shown],
        s=[8.0 * math.sqrt(entry.count) for entry in shown],
        alpha=0.7,
        clip_on=False,
        label=label,
    )


def _draw(axes: Axes, reliability: Reliability, label: str) -> None:
    shown = [entry for entry in reliability.bins if entry.count >= _MIN_COUNT]
    axes.plot(
        [entry.mean_probability for entry in shown],
        [entry.share_true for entry in shown],
        marker="o",
        markersize=3,
        label=label,
    )


def _class_table(calibration: CalibrationRecord) -> str:
    return markdown_table(
        ("network", "probability of", "points", "ECE before", "ECE after", "Brier before", "after"),
        [
            (
                network.network,
                curve.statement,
                str(curve.after.count),
                f"{100 * curve.before.expected_error:.2f} %",
                f"{100 * curve.after.expected_error:.2f} %",
                f"{curve.before.brier:.4f}",
                f"{curve.after.brier:.4f}",
            )
            for network in calibration.networks
            for curve in network.curves
        ],
    )


def _confidence_table(confidences: Mapping[str, Reliability]) -> str:
    rows: list[tuple[str, ...]] = []
    for name, reliability in confidences.items():
        weighted = [(entry.count / reliability.count, entry) for entry in reliability.bins]
        rows.append(
            (
                name,
                str(reliability.count),
                f"{100 * sum(share * entry.mean_probability for share, entry in weighted):.1f} %",
                f"{100 * sum(share * entry.share_true for share, entry in weighted):.1f} %",
                f"{100 * reliability.expected_error:.2f} %",
                f"{reliability.brier:.4f}",
            )
        )
    return markdown_table(
        ("networks", "bolts stated", "mean confidence", "right", "ECE", "Brier"), rows
    )
