"""`boltpose prior edit`: the human check of a prior before production, without a screen."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_console, note
from boltpose.cli.options import JsonOption, PictureOption, PriorArgument
from boltpose.cli.outputs import PICTURE_SUFFIXES, PRIOR_SUFFIXES, check_output
from boltpose.errors import ConfigError

ByOption = Annotated[
    str, typer.Option("--by", metavar="WHO", help="Who did it; is written into the prior.")
]
DateOption = Annotated[
    str,
    typer.Option(
        "--date",
        metavar="WHEN",
        help="When it was done; is written into the prior. Left out by default, so that the same "
        "edits give the same bytes.",
    ),
]


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
    flip: Annotated[
        list[str] | None,
        typer.Option(
            "--flip",
            metavar="ID",
            help="A bolt whose head looks the other way; it gets an id of that side.",
        ),
    ] = None,
    name: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="ID=NAME", help="What people call a bolt; ID= for nothing."),
    ] = None,
    tool: Annotated[
        list[str] | None,
        typer.Option("--tool", metavar="ID=TOOL", help="The tool that turns it, e.g. T1='hex 8'."),
    ] = None,
    order: Annotated[
        list[str] | None,
        typer.Option("--order", metavar="ID=N", help="Its turn, from 1; ID= for none."),
    ] = None,
    by: ByOption = "",
    date: DateOption = "",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="By default PRIOR is replaced."),
    ] = None,
    picture: PictureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Add, remove, confirm, flip or name bolts; each option may be given several times.

    Ids are those of PRIOR: bolts are flipped last. In a browser: `boltpose prior review`.
    """
    if not (add or remove or confirm or flip or name or tool or order):
        raise ConfigError(
            "nothing to edit: give --add, --remove, --confirm, --flip, --name, --tool or --order"
        )
    clicks = [_parse_point(text) for text in add or []]
    names = _parse_pairs("--name", name)
    tools = _parse_pairs("--tool", tool)
    orders = {key: _parse_turn(text) for key, text in _parse_pairs("--order", order).items()}
    target = output or prior
    check_output(target, PRIOR_SUFFIXES)
    check_output(picture, PICTURE_SUFFIXES, inputs=(prior, target))

    from boltpose.cli.tables import describe_prior
    from boltpose.io.digest import sha256_of
    from boltpose.prior.file import prior_to_json, read_prior, write_prior
    from boltpose.prior.review import require_no_review
    from boltpose.prior.review_edits import (
        AddBolt,
        ConfirmBolt,
        Edit,
        FlipBolt,
        NameBolt,
        RemoveBolt,
        SetOrders,
        SetTool,
        apply_edit,
    )
    from boltpose.prior.review_notes import with_review

    edited = read_prior(prior)
    if target.exists():
        require_no_review(target)
    # removed first: a wrong bolt may stand where the right one is to be added
    edits: list[Edit] = [RemoveBolt(bolt=bolt) for bolt in remove or []]
    edits += [ConfirmBolt(bolt=bolt) for bolt in confirm or []]
    edits += [AddBolt(position_mm=click) for click in clicks]
    edits += [NameBolt(bolt=bolt, name=words) for bolt, words in names.items()]
    edits += [SetTool(bolts=(bolt,), tool=words) for bolt, words in tools.items()]
    if orders:
        edits.append(SetOrders(orders=tuple(orders.items())))
    # flipped last: a flipped bolt has another id
    edits += [FlipBolt(bolt=bolt) for bolt in flip or []]
    for entry in edits:
        edited = apply_edit(edited, entry)
    edited = with_review(edited, edits, base_sha256=sha256_of(prior), by=by, date=date)
    if picture is not None:
        from boltpose.picture import draw_prior

        draw_prior(picture, edited)
    write_prior(target, edited)
    if as_json:
        typer.echo(json.dumps(prior_to_json(edited), indent=2))
        return
    answer_console().print(describe_prior(edited))
    note(f"wrote {target}")


def _parse_point(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"--add wants three numbers x,y,z in mm, got '{text}'") from None
    if not all(math.isfinite(value) for value in (x, y, z)):
        raise ConfigError(f"--add wants finite numbers, got '{text}'")
    return x, y, z


def _parse_pairs(option: str, texts: list[str] | None) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for text in texts or []:
        bolt, equals, words = text.partition("=")
        bolt = bolt.strip()
        if not equals or not bolt:
            raise ConfigError(f"{option} wants ID=..., for example T1=..., got '{text}'")
        if bolt in pairs:
            raise ConfigError(f"{option} is given twice for bolt '{bolt}'")
        pairs[bolt] = words
    return pairs


def _parse_turn(text: str) -> int | None:
    if not text.strip():
        return None
    try:
        return int(text)
    except ValueError:
        raise ConfigError(f"--order wants a number from 1, got '{text}'") from None
