"""`boltpose synth model|spec|families`: one motor, written down by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_console, answer_json, answer_text, note
from boltpose.cli.outputs import POSES_SUFFIXES, check_folder, check_output
from boltpose.errors import ConfigError


def synth_model(
    spec: Annotated[
        Path, typer.Argument(metavar="SPEC.json", help="As `boltpose synth spec` writes it.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the model.")
    ],
) -> None:
    """Build the motor of a specification: meshes, labels, bolt poses, and its prior."""
    check_folder(output, "the model")

    from boltpose.synthesis.user_model import read_spec, write_model

    chosen = read_spec(spec)
    try:
        written = write_model(chosen, output)
    except ConfigError as error:  # it names the field, not the file it stands in
        raise ConfigError(f"{spec}: {error}") from error
    for path in written.files:
        note(f"wrote {path}")
    answer_json(
        {
            "files": [str(path) for path in written.files],
            "prior": str(written.prior),
            "bolts": written.bolt_count,
        }
    )
    answer_text(
        f"'{chosen.name}': {written.bolt_count} bolts, {written.part_count} parts; "
        f"locate it with --prior {written.prior}"
    )


def synth_spec(
    family: Annotated[
        str | None,
        typer.Option("--family", metavar="NAME", help="See `boltpose synth families`."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Another seed, another motor.")] = 0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="By default it is printed."),
    ] = None,
) -> None:
    """Write an example specification: change what differs on your bench."""
    check_output(output, POSES_SUFFIXES)

    from boltpose.synthesis.user_model import example_spec, write_spec

    chosen = example_spec(family, seed)
    if output is None:
        typer.echo(chosen.model_dump_json(indent=1))
        return
    write_spec(output, chosen)
    answer_json({"files": [str(output)]})
    note(f"wrote {output}")


def synth_families() -> None:
    """List the topologies of motors and the designs of clamps."""
    from boltpose.factory.families import FAMILIES
    from boltpose.factory.scene import CLAMPS

    answer_json({"families": list(FAMILIES), "clamps": list(CLAMPS)})
    answer = answer_console()
    answer.print("[bold]families[/]")
    for name in FAMILIES:
        answer.print(f"  {name}")
    answer.print("[bold]clamps[/]")
    for name in CLAMPS:
        answer.print(f"  {name}")
