"""What every command can: `--quiet`, `--json`, and examples at the end of its help."""

from __future__ import annotations

from typing import Annotated, Protocol, cast

import typer

from boltpose.cli.console import OUTPUT
from boltpose.cli.examples import EXAMPLES


class _Named(Protocol):
    opts: list[str]


class _Command(Protocol):
    """What is used of typer's commands, whose base classes are private."""

    name: str | None
    params: list[_Named]
    epilog: str | None


def _be_quiet(context: typer.Context, value: bool) -> None:
    if value and not context.resilient_parsing:
        OUTPUT.is_quiet = True


def _answer_json(context: typer.Context, value: bool) -> None:
    if value and not context.resilient_parsing:
        OUTPUT.is_json = True


def _options(
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print JSON, and nothing else, to stdout.",
            callback=_answer_json,
            expose_value=False,
        ),
    ] = False,
    quiet: Annotated[
        bool,
        typer.Option(
            "--quiet",
            "-q",
            help="No notes and no progress; warnings, errors and the answer stay.",
            callback=_be_quiet,
            expose_value=False,
        ),
    ] = False,
) -> None:
    """Exists for its parameters only."""


def add_manners(root: object) -> None:
    """Give every command of a tree its common options and its examples.

    Args:
        root: What `typer.main.get_command` returned; it is changed.
    """
    carrier = typer.Typer(add_completion=False)
    carrier.command()(_options)
    shared = cast(_Command, typer.main.get_command(carrier)).params
    for path, command in leaf_commands(root).items():
        known = {name for param in command.params for name in param.opts}
        command.params.extend(param for param in shared if not known & set(param.opts))
        lines = EXAMPLES.get(path, ())
        if lines:
            title = "Examples:" if len(lines) > 1 else "Example:"
            # an empty line between, or the lines of an epilog flow into each other
            command.epilog = "\n\n".join((title, *lines))


def leaf_commands(root: object) -> dict[str, _Command]:
    """Return every command that does something by its words, for example `prior build`."""
    found: dict[str, _Command] = {}

    def walk(node: object, words: tuple[str, ...]) -> None:
        below: dict[str, object] | None = getattr(node, "commands", None)
        if below is None:
            found[" ".join(words)] = cast(_Command, node)
            return
        for name, child in below.items():
            walk(child, (*words, name))

    walk(root, ())
    return found
