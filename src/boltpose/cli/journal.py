"""`boltpose journal`: what the service was asked and answered, for an auditor."""

from __future__ import annotations

import json
import shutil
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from boltpose.cli.cell import ConfigOption, open_cell
from boltpose.cli.console import answer_console, answer_json, note_console
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.options import JsonOption, ModelsOption
from boltpose.errors import ConfigError, InputFileError

if TYPE_CHECKING:
    from boltpose.service.journal import Entry, Journal

journal_app = typer.Typer(help="What the service was asked and answered: list, show, replay.")

DataOption = Annotated[
    Path | None,
    typer.Option("--data", metavar="DIR", help="The service's folder, as for `serve`."),
]
DatabaseOption = Annotated[
    str | None,
    typer.Option("--database", metavar="URL", help="As for `serve`, if it was given there."),
]
IdArgument = Annotated[str, typer.Argument(metavar="ID", help="As `journal list` shows it.")]


@journal_app.callback(invoke_without_command=True)
def _show_help(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@journal_app.command("list")
def list_entries(
    data: DataOption = None,
    database: DatabaseOption = None,
    config: ConfigOption = None,
    limit: Annotated[int, typer.Option("--limit", min=1, max=100_000, help="At most.")] = 20,
    as_json: JsonOption = False,
) -> None:
    """List the latest requests, newest first."""
    journal = _open(config, data, database)
    with closing(journal):
        entries = journal.entries(limit=limit)
    if as_json:
        typer.echo(json.dumps([entry.to_json(with_result=False) for entry in entries], indent=2))
        return
    for entry in entries:
        outcome = " ".join(
            part for part in (entry.status or entry.error_code, entry.reason) if part
        )
        time_s = "" if entry.seconds is None else f"{entry.seconds:.2f} s"
        answer_console().print(
            f"{entry.id}  {entry.kind:6s}  {entry.state.value:11s}  {outcome or '-'}  "
            f"{entry.prior}  {entry.client}  {time_s}",
            markup=False,
            soft_wrap=True,
        )


@journal_app.command("show")
def show_entry(
    entry: IdArgument,
    data: DataOption = None,
    database: DatabaseOption = None,
    config: ConfigOption = None,
) -> None:
    """Print all of one request as JSON."""
    journal = _open(config, data, database)
    with closing(journal):
        found = _find(journal, entry)
    typer.echo(json.dumps(found.to_json(with_result=True), indent=2))


@journal_app.command("export")
def export_entry(
    entry: IdArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="A new folder for the files.")
    ],
    data: DataOption = None,
    database: DatabaseOption = None,
    config: ConfigOption = None,
) -> None:
    """Write the input and poses.json of one request, for `boltpose view` and `boltpose report`."""
    from boltpose.service.calls import LocateCall

    if output.exists():
        raise InputFileError(output, "something there already", "a new folder")
    journal = _open(config, data, database)
    with closing(journal):
        found = _find(journal, entry)
    if found.kind != "locate":
        raise ConfigError(f"{entry} is a '{found.kind}' request, wanted a 'locate' one")
    call = LocateCall.from_json(found.call)
    sources = [(journal.blobs.find(blob), blob) for blob in call.blobs]
    output.mkdir(parents=True)
    for source, blob in sources:
        place = output / blob.file_name
        if place.exists():  # two files of one name: the folder of the request tells them apart
            place = output / blob.sha256[:8] / blob.file_name
            place.parent.mkdir(exist_ok=True)
        shutil.copyfile(source, place)
    if found.result is not None:
        (output / "poses.json").write_text(found.result, encoding="utf-8")
    answer_json({"written": str(output)})
    note_console().print(f"wrote {output}", markup=False, soft_wrap=True)


@journal_app.command("replay")
def replay_entries(
    entries: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ID...]", help="Requests; or --last N."),
    ] = None,
    last: Annotated[
        int | None, typer.Option("--last", min=1, metavar="N", help="The latest N with an answer.")
    ] = None,
    data: DataOption = None,
    database: DatabaseOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
    models: ModelsOption = None,
) -> None:
    """Compute stored requests again and compare: the same input must give the same poses.

    Exit code 3 if one differs; timings do not count.
    """
    if bool(entries) == (last is not None):
        raise ConfigError("name requests to replay, or give --last N")

    from boltpose.service.execute import Executor
    from boltpose.service.replay import replay

    journal = _open(config, data, database)
    with closing(journal):
        names = entries or [e.id for e in journal.entries(limit=last or 1, can_replay=True)]
        if not names:
            raise ConfigError("the journal holds no answered request with its input")
        executor = Executor(journal.data, models)
        outcomes = [replay(_find(journal, name), executor) for name in names]
    if as_json:
        answer = [
            {"id": one.id, "same": one.is_same, "differences": list(one.differences)}
            for one in outcomes
        ]
        typer.echo(json.dumps(answer, indent=2))
    else:
        for one in outcomes:
            word = "same" if one.is_same else "DIFFERS"
            answer_console().print(f"{one.id}  {word}", markup=False)
            for line in one.differences:
                answer_console().print(f"  {line}", markup=False, soft_wrap=True)
    if not all(one.is_same for one in outcomes):
        raise typer.Exit(ExitCode.REFUSED)


@journal_app.command("report")
def report_entry(
    entry: IdArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The page, .html.")
    ],
    data: DataOption = None,
    database: DatabaseOption = None,
    config: ConfigOption = None,
) -> None:
    """Write the page of one request, as `boltpose report` does."""
    from boltpose.cli.outputs import check_output

    check_output(output, (".html",))

    from boltpose.service.calls import LocateCall
    from boltpose.service.execute import Executor

    journal = _open(config, data, database)
    with closing(journal):
        found = _find(journal, entry)
    if found.kind != "locate" or found.result is None:
        raise ConfigError(f"{entry} has no poses.json: {found.kind} {found.state.value}")
    Executor(journal.data).report(LocateCall.from_json(found.call), found.result, output)
    answer_json({"written": str(output)})
    note_console().print(f"wrote {output}", markup=False, soft_wrap=True)


def _open(config: Path | None, data: Path | None, database: str | None) -> Journal:
    """The journal of a service, which must be there already."""
    from boltpose.service.config import ServiceConfig
    from boltpose.service.database import DATABASE_FILE
    from boltpose.service.journal import Journal

    settings = open_cell(config).settings("service", ServiceConfig)
    folder = data or Path(settings.data)
    # a folder that was named is not that of the settings, and so its database is neither
    url = database or (settings.database if data is None else None)
    if not (folder / "instance").is_file():
        raise InputFileError(
            folder, "no journal", "the folder of a service (boltpose serve --data)"
        )
    if url is None and not (folder / DATABASE_FILE).is_file():
        raise InputFileError(
            folder, f"no {DATABASE_FILE}", "--database URL as the service has it, or such a file"
        )
    return Journal(folder, url)


def _find(journal: Journal, entry: str) -> Entry:
    found = journal.find(entry)
    if found is None:
        raise ConfigError(f"no request '{entry}' in the journal, see `boltpose journal list`")
    return found
