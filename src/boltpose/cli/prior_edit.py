"""`boltpose prior edit`: the human check of a prior before production."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_console, note_console
from boltpose.cli.options import JsonOption, PictureOption, PriorArgument
from boltpose.cli.outputs import PICTURE_SUFFIXES, PRIOR_SUFFIXES, check_output
from boltpose.errors import ConfigError


def edit(
    prior: PriorArgument,
    add: Annotated[
        list[str] | None,
        typer.Option(
            "--add", metavar="X,Y,Z", help="A point on a missed head, mm, frame of the full scan."
        ),
    ] = None,
    remove: Annotated[
        list[str] | None, typer.Option("--remove", metavar="ID", help="A bolt that is none.")
    ] = None,
    confirm: Annotated[
        list[str] | None,
        typer.Option("--confirm", metavar="ID", help="An unsure bolt that a person found right."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="By default PRIOR is replaced."),
    ] = None,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Add, remove or confirm bolts; each option may be given several times."""
    if not (add or remove or confirm):
        raise ConfigError("nothing to edit: give --add, --remove or --confirm")
    clicks = [_parse_point(text) for text in add or []]
    target = output or prior
    check_output(target, PRIOR_SUFFIXES)
    check_output(picture, PICTURE_SUFFIXES, inputs=(prior, target))

    from boltpose.cli.tables import describe_prior
    from boltpose.prior.edit import add_bolt, confirm_bolt, remove_bolt
    from boltpose.prior.file import prior_to_json, read_prior, write_prior

    edited = read_prior(prior)
    # removed first: a wrong bolt may stand where the right one is to be added
    for bolt_id in remove or []:
        edited = remove_bolt(edited, bolt_id)
    for bolt_id in confirm or []:
        edited = confirm_bolt(edited, bolt_id)
    for click in clicks:
        edited = add_bolt(edited, click)
    if picture is not None:
        from boltpose.picture import draw_prior

        draw_prior(picture, edited)
    write_prior(target, edited)
    if as_json:
        typer.echo(json.dumps(prior_to_json(edited), indent=2))
        return
    answer_console().print(describe_prior(edited))
    note_console().print(f"wrote {target}", soft_wrap=True)


def _parse_point(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"--add wants three numbers x,y,z in mm, got '{text}'") from None
    if not all(math.isfinite(value) for value in (x, y, z)):
        raise ConfigError(f"--add wants finite numbers, got '{text}'")
    return x, y, z
