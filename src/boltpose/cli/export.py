"""`boltpose export`: a network somebody trained, as one file that needs no PyTorch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_json, answer_text, note
from boltpose.cli.outputs import check_output
from boltpose.errors import MissingExtraError

_SUFFIXES = (".onnx",)


def export_network(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder of `boltpose train … --out RUN`.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="By default parts.onnx or scene.onnx in RUN."
        ),
    ] = None,
    half: Annotated[
        bool,
        typer.Option("--half/--full", help="Store weights with 16 bits, or with all 32."),
    ] = True,
) -> None:
    """Write the network of a training run as ONNX, and check that both answer the same."""
    check_output(output, _SUFFIXES)
    try:
        from boltpose.training.export_run import export_run
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.split(".")[0] == "boltpose":
            raise
        raise MissingExtraError(str(error.name), "train") from error
    report = export_run(run, output, half=half)
    found = report.agreement
    sizes = ", ".join(f"{clouds} x {points}" for clouds, points in report.sizes)
    answer_json(
        {
            "file": str(report.path),
            "kind": report.kind,
            "backbone": report.backbone,
            "bytes": report.file_bytes,
            "largest_difference": float(found.largest),
            "same_labels": float(found.same_label),
        }
    )
    answer_text(
        f"{report.path}: {report.kind}, {report.backbone}, {report.file_bytes / 1e6:.2f} MB\n"
        f"class probabilities differ by at most {found.largest:.1e} from the network, at 99 % of "
        f"the points by {found.usual:.1e}; {100 * found.same_label:.2f} % of the labels are the "
        f"same (clouds x points: {sizes})"
    )
    note(f"use it: boltpose prior build … --models {report.path.parent}")
