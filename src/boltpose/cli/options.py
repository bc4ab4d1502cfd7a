"""Option types that several commands share, so that one name means one thing everywhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class LengthUnit(StrEnum):
    """Units of input files, as `boltpose.io` knows them (a test compares the two).

    Kept here too because importing `boltpose.io` would make `--help` slow.
    """

    MM = "mm"
    M = "m"
    CM = "cm"
    INCH = "inch"


UnitOption = Annotated[
    LengthUnit, typer.Option("--unit", help="Unit of the file's coordinates; never guessed.")
]
ModelsOption = Annotated[
    Path | None,
    typer.Option(
        "--models", metavar="DIR", help="Folder with other networks than the shipped ones."
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print JSON, and nothing else, to stdout.")
]
PictureOption = Annotated[
    Path | None,
    typer.Option("--picture", metavar="FILE", help="Draw the result: .png, .svg or .pdf."),
]
PriorArgument = Annotated[
    Path, typer.Argument(metavar="PRIOR", help="A .prior.npz of `boltpose prior build`.")
]
