"""`boltpose synth preview|card|compare`: what a data set holds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_json, note

DataArgument = Annotated[Path, typer.Argument(metavar="DIR", help="A data set.")]


def synth_preview(data: DataArgument) -> None:
    """Draw contact sheets of a data set into its folder `preview`."""
    from boltpose.synthesis.preview import write_previews

    written = list(write_previews(data))
    for path in written:
        note(f"wrote {path}")
    answer_json({"files": [str(path) for path in written]})


def synth_card(data: DataArgument) -> None:
    """Write the data card, README.md, again from what is on disk."""
    from boltpose.synthesis.card import write_card

    card = write_card(data)
    note(f"wrote {card}")
    answer_json({"files": [str(card)]})


def synth_compare(
    data: Annotated[
        list[Path], typer.Argument(metavar="DIR", help="Data sets in the layout of reman18.")
    ],
) -> None:
    """Print the ranges of data sets side by side, as a Markdown table."""
    from boltpose.synthesis.compare import compare_table
    from boltpose.synthesis.statistics import read_statistics

    read = [read_statistics(root) for root in data]
    table = compare_table(read, [root.resolve().name for root in data])
    if not answer_json({"markdown": table}):
        typer.echo(table, nl=False)
