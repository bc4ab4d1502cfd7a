"""The `boltpose` command: its tree of subcommands, and errors turned into exit codes."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from typing import Annotated, NoReturn

import typer

from boltpose import __version__
from boltpose.cli import (
    config,
    demo,
    evaluate,
    export,
    export_poses,
    journal,
    label,
    locate,
    prior_build,
    prior_edit,
    prior_review,
    prior_show,
    report,
    reproduce,
    serve,
    synth,
    synth_model,
    synth_pictures,
    synth_sets,
    train,
    view,
)
from boltpose.cli.console import OUTPUT
from boltpose.cli.error_line import error_line, refuse_empty_words
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.manners import add_manners
from boltpose.errors import BoltposeError

app = typer.Typer(
    name="boltpose",
    add_completion=True,
    pretty_exceptions_enable=False,
    epilog="Exit codes: 0 ok, 2 bad input, 3 pose refused, 130 interrupted, "
    "143 terminated. Every command has --json and --quiet. Start: boltpose demo",
)
prior_app = typer.Typer(help="Build, look at and correct what is known of a motor beforehand.")
train_app = typer.Typer(help="Train the networks (needs the `train` extra).")
synth_app = typer.Typer(help="Synthetic motors and clamps, labelled (needs the `synth` extra).")
config_app = typer.Typer(help="The settings of a cell, `boltpose.toml`: write, test and show them.")
app.add_typer(config_app, name="config")
app.add_typer(prior_app, name="prior")
app.add_typer(journal.journal_app, name="journal")
app.add_typer(synth_app, name="synth")
app.add_typer(train_app, name="train")

config_app.command("init")(config.init)
config_app.command("check")(config.check)
config_app.command("show")(config.show)
prior_app.command("build")(prior_build.build)
prior_app.command("show")(prior_show.show)
prior_app.command("edit")(prior_edit.edit)
prior_app.command("review")(prior_review.review)
app.command("locate")(locate.locate_bolts)
app.command("demo")(demo.run_demo)
app.command("view")(view.view)
app.command("evaluate")(evaluate.evaluate)
app.command("export")(export.export_network)
app.command("export-poses")(export_poses.export_poses)
app.command("label")(label.label_scan)
app.command("report")(report.write_report_of)
app.command("reproduce")(reproduce.reproduce)
app.command("serve")(serve.serve)
train_app.command("parts")(train.train_parts)
train_app.command("scene")(train.train_scene)
synth_app.command("motors")(synth.synth_motors)
synth_app.command("scenes")(synth.synth_scenes)
synth_app.command("model")(synth_model.synth_model)
synth_app.command("spec")(synth_model.synth_spec)
synth_app.command("families")(synth_model.synth_families)
synth_app.command("preview")(synth_sets.synth_preview)
synth_app.command("pictures")(synth_pictures.synth_pictures)
synth_app.command("card")(synth_sets.synth_card)
synth_app.command("compare")(synth_sets.synth_compare)


@config_app.callback(invoke_without_command=True)
@prior_app.callback(invoke_without_command=True)
@synth_app.callback(invoke_without_command=True)
@train_app.callback(invoke_without_command=True)
def _show_help(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.callback(invoke_without_command=True)
def _main_options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and end.")] = False,
) -> None:
    """The 6D pose of every bolt of a clamped motor, also of the bolts the camera cannot see."""
    if version:
        typer.echo(__version__)
        raise typer.Exit(ExitCode.OK)
    _show_help(context)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; our own errors become one line on stderr.

    Args:
        arguments: The command line without the program's name; that of the process by default.

    Returns:
        The exit code, see `ExitCode`. Anything that is not the user's doing is not caught: a
        traceback is what a bug report needs.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    _open_closed_streams()
    OUTPUT.reset()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files may be no UTF-8
    command = typer.main.get_command(app)
    add_manners(command)
    try:
        refuse_empty_words(given)
        with _terminable():
            code = command.main(args=given, prog_name="boltpose", standalone_mode=False)
        sys.stdout.flush()  # here, where a full disk or a closed pipe is still an error of ours
    except (BrokenPipeError, SystemExit) as error:
        if isinstance(error, SystemExit) and not error.code:
            return ExitCode.OK  # how typer ends after shell completion
        # the reader (`| head`) has gone, and typer would end the process with a code of its own;
        # without the next line Python complains once more while it ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.BAD_INPUT
    except (BoltposeError, OSError, typer.TyperException) as error:
        return _tell(error_line(error), ExitCode.BAD_INPUT, given)
    except (KeyboardInterrupt, typer.Abort):
        return _tell(OUTPUT.interruption, ExitCode.INTERRUPTED, given)
    except _TerminatedError:
        return _tell("terminated", ExitCode.TERMINATED, given)
    if code == ExitCode.INTERRUPTED:  # what typer makes of Ctrl-C, without a word
        return _tell(OUTPUT.interruption, ExitCode.INTERRUPTED, given)
    return code if isinstance(code, int) else ExitCode.OK


class _TerminatedError(BaseException):
    """SIGTERM came; no Exception, so that nothing but `main` catches it."""


@contextmanager
def _terminable() -> Generator[None]:
    """Let SIGTERM unwind the stack, so that half-written files go as they do after Ctrl-C."""
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    owner = os.getpid()

    def end(number: int, frame: object) -> NoReturn:
        del frame
        if os.getpid() != owner:  # a forked worker: it dies as it would have without us
            os._exit(128 + number)
        raise _TerminatedError

    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _open_closed_streams() -> None:
    """Give a process that was started without stdout or stderr (`>&-`) one that holds nothing."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))


def _tell(text: str, code: ExitCode, arguments: Sequence[str]) -> ExitCode:
    """Say why there is no answer: a line on stderr, and with `--json` a document on stdout.

    Where that cannot be written either (a full disk), the exit code says it alone.
    """
    with suppress(OSError):
        typer.echo(f"boltpose: {text}", err=True)
    try:
        if "--json" in arguments and not OUTPUT.has_answered:  # never two documents
            error = {"message": text, "exit_code": int(code)}
            typer.echo(json.dumps({"error": error}, indent=2))
        sys.stdout.flush()
    except OSError:  # or Python complains once more while it ends, with a code of its own
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code
