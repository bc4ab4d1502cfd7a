"""An error as the one line a person reads: what is wrong, what was likely meant, what to do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import typer

from boltpose.errors import ConfigError, InputFileError


def error_line(error: BaseException) -> str:
    """Say in one line what is wrong.

    Args:
        error: One of ours, of the operating system or of typer.
    """
    if isinstance(error, typer.TyperException):
        text = _of_command_line(error)
    elif isinstance(error, InputFileError):
        from boltpose.cell.slips import tell_file_error

        text = tell_file_error(error)
    elif isinstance(error, OSError) and error.filename is not None and error.strerror:
        text = f"{error.filename}: {error.strerror.lower()}"
    else:
        text = str(error)
    return " ".join(text.split())


def refuse_empty_words(arguments: Sequence[str]) -> None:
    """Refuse `--prior ""`, which a script with an unset variable says and which means `.`.

    Raises:
        ConfigError: A word of the command line is empty, or an option ends in `=`.
    """
    for place, word in enumerate(arguments):
        if not word:
            after = f" after {arguments[place - 1]}" if place else ""
            raise ConfigError(f"found ''{after}; is a variable of the script not set?")
        if word.startswith("--") and word.endswith("="):
            raise ConfigError(f"found nothing after {word}; is a variable of the script not set?")


def _of_command_line(error: typer.TyperException) -> str:
    """What typer says; it suggests commands and options itself, but no choices."""
    text = error.format_message()
    kind: Any = getattr(getattr(error, "param", None), "type_descriptor", None)
    cause: Any = error.__cause__
    if kind is not None and cause is not None:
        given, name = str(cause.errors()[0]["input"]), error.param.get_error_hint()  # pyright: ignore
        if kind.is_choice:
            from boltpose.cell.slips import did_you_mean

            known = [str(choice) for choice in kind.choices]
            given_hint = f"'{given}'{did_you_mean(given, known)}"
            text = f"{name}: found {given_hint}, wanted {', '.join(known)}"
        else:
            wanted = cause.errors()[0]["msg"].split(",")[0]
            text = f"Invalid value for {name}: {wanted}, found '{given}'"
    context: Any = getattr(error, "ctx", None)
    if context is not None:
        text = f"{text.rstrip('.')}; see `{context.command_path} --help`"
    return text
