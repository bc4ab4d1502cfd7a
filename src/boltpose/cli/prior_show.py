"""`boltpose prior show`: what a prior holds."""

from __future__ import annotations

import json

import typer

from boltpose.cli.console import answer_console
from boltpose.cli.options import JsonOption, PictureOption, PriorArgument
from boltpose.cli.outputs import PICTURE_SUFFIXES, check_output


def show(prior: PriorArgument, picture: PictureOption = None, as_json: JsonOption = False) -> None:
    """Show the bolts of a prior, and which of them a person should look at."""
    check_output(picture, PICTURE_SUFFIXES, inputs=(prior,))

    from boltpose.cli.tables import describe_prior
    from boltpose.prior.file import prior_to_json, read_prior

    known = read_prior(prior)
    if picture is not None:
        from boltpose.picture import draw_prior

        draw_prior(picture, known)
    if as_json:
        typer.echo(json.dumps(prior_to_json(known), indent=2))
    else:
        answer_console().print(describe_prior(known))
