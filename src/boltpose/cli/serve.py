"""`boltpose serve`: the main job over HTTP."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from boltpose.cli.cell import ConfigOption, open_cell
from boltpose.cli.console import answer_console, answer_json, note, note_console
from boltpose.cli.options import ModelsOption

if TYPE_CHECKING:
    from boltpose.service.config import ServiceConfig


def serve(
    host: Annotated[
        str | None,
        typer.Option("--host", help="Address to listen on; 127.0.0.1. Others need an API key."),
    ] = None,
    port: Annotated[int | None, typer.Option("--port", help="8130; 0 takes a free one.")] = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="Its own folder: journal, stored inputs, keys."),
    ] = None,
    priors: Annotated[
        Path | None, typer.Option("--priors", metavar="DIR", help="Folder of .prior.npz files.")
    ] = None,
    scans: Annotated[
        Path | None,
        typer.Option(
            "--scans", metavar="DIR", help="Folder whose files requests may name by path."
        ),
    ] = None,
    database: Annotated[
        str | None,
        typer.Option("--database", metavar="URL", help="The journal; by default SQLite in DIR."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", help="Processes that locate; 1.")
    ] = None,
    queue_size: Annotated[
        int | None, typer.Option("--queue", help="Requests that may wait; 8.")
    ] = None,
    allowed_host: Annotated[
        list[str] | None,
        typer.Option("--allowed-host", metavar="NAME", help="One more name clients may use."),
    ] = None,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Clients may not build or delete priors.")
    ] = False,
    new_key: Annotated[
        str | None,
        typer.Option("--new-key", metavar="NAME", help="Make an API key, print it once, and end."),
    ] = None,
    remove_key: Annotated[
        str | None, typer.Option("--remove-key", metavar="ID", help="Forget a key, and end.")
    ] = None,
    list_keys: Annotated[
        bool, typer.Option("--list-keys", help="List who has a key, and end.")
    ] = False,
    models: ModelsOption = None,
    config: ConfigOption = None,
) -> None:
    """Answer requests over HTTP: locate, priors, journal, health, metrics.

    As soon as there is one API key, every request needs one.
    """
    from boltpose.service.config import ServiceConfig

    settings = with_options(
        open_cell(config).settings("service", ServiceConfig),
        host=host,
        port=port,
        data=data,
        priors=priors,
        scans=scans,
        models=models,
        database=database,
        workers=workers,
        queue_size=queue_size,
        allowed_hosts=tuple(allowed_host) if allowed_host else None,
        can_change_priors=False if read_only else None,
    )
    if new_key is not None or remove_key is not None or list_keys:
        _change_keys(Path(settings.data), new_key, remove_key, wants_list=list_keys)
        return

    from boltpose.segmentation.models import load_models
    from boltpose.service.serve import serve as run_service

    # before a folder is made: a worker would find it out later, and in more words
    load_models(None if settings.models is None else Path(settings.models))
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s %(message)s")

    def on_ready(url: str) -> None:
        if not answer_json({"url": url}):
            typer.echo(f"boltpose serves {url}  (stop: Ctrl-C)")
        note(f"priors {settings.priors}, journal and inputs {settings.data}")

    run_service(settings, on_ready)


def with_options(config: ServiceConfig, **options: Any) -> ServiceConfig:
    """Return the settings with those options that were given (not None)."""
    from dataclasses import replace

    given = {
        name: str(value) if isinstance(value, Path) else value
        for name, value in options.items()
        if value is not None
    }
    return replace(config, **given)


def _change_keys(data: Path, new: str | None, remove: str | None, *, wants_list: bool) -> None:
    from boltpose.service.keys import KeyRing

    data.mkdir(parents=True, exist_ok=True)
    ring = KeyRing(data)
    answer: dict[str, Any] = {}
    if remove is not None:
        removed = ring.remove(remove)
        answer["removed"] = removed.name
        note_console().print(f"removed the key of {removed.name}", markup=False)
    if new is not None:
        key = ring.add(new)
        note_console().print("this key is shown once; only its hash is kept:", markup=False)
        answer["key"] = key
        answer_console().print(key, markup=False, soft_wrap=True)
    if wants_list:
        answer["keys"] = [
            {"id": entry.id, "created": str(entry.created), "name": entry.name}
            for entry in ring.keys
        ]
        for entry in ring.keys:
            answer_console().print(f"{entry.id}  {entry.created}  {entry.name}", markup=False)
    answer_json(answer)
    if new is not None or remove is not None:
        note_console().print("a running service takes it after a restart", markup=False)
