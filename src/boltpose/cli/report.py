"""`boltpose report`: the page of a result that was saved as `poses.json`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import note
from boltpose.cli.options import JsonOption
from boltpose.cli.outputs import REPORT_SUFFIXES, check_output, remove_stale


def write_report_of(
    poses: Annotated[
        Path, typer.Argument(metavar="POSES", help="A poses.json of `boltpose locate -o`.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="The page; by default POSES with .html."
        ),
    ] = None,
    scan: Annotated[
        Path | None,
        typer.Option("--scan", metavar="FILE", help="The scan, if it is not where it was."),
    ] = None,
    prior: Annotated[
        Path | None,
        typer.Option("--prior", metavar="FILE|DIR", help="The prior, if it is not where it was."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write one page about a result: verdict, pictures, bolts, scores; prints on one A4 sheet."""
    from boltpose.io.guard import require_file

    require_file(poses, "a poses.json of `boltpose locate -o`")
    target = output or poses.with_suffix(".html")
    check_output(target, REPORT_SUFFIXES, inputs=(poses, scan, prior))

    from boltpose.report import write_report
    from boltpose.saved_result import open_saved_result

    # an older page must not pass for this result's, whatever fails below
    remove_stale(target)
    saved = open_saved_result(poses, scan, prior)
    write_report(target, saved.result, saved.scan, saved.prior, saved.timings_ms)
    if as_json:
        typer.echo(json.dumps({"page": str(target), "status": saved.result.verdict.status}))
    else:
        note(f"wrote {target}")
