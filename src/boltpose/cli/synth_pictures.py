"""`boltpose synth pictures`: the pictures of the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_json, answer_text, note
from boltpose.cli.outputs import check_folder


def synth_pictures(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the pictures.")
    ],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Another seed, other motors.")] = 0,
    only: Annotated[
        str | None,
        typer.Option("--only", metavar="A,B", help="Only these, for example `families,camera`."),
    ] = None,
) -> None:
    """Draw every family, clamp design and sensor effect; some minutes."""
    check_folder(output, "the pictures")

    from boltpose.synthesis.pictures import write_pictures

    def report(path: Path) -> None:
        note(f"wrote {path}")

    names = tuple(name.strip() for name in only.split(",")) if only else ()
    written = write_pictures(output, seed=seed, only=names, report=report)
    answer_json({"files": [str(path) for path in written]})
    answer_text(f"{len(written)} pictures in {output}")
