"""An error as the one line a person reads: what is wrong, what was likely meant, what to do."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
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
    elif isinstance(error, InputFileError) and error.found.startswith("no "):
        text = str(error).replace(error.found, error.found + _near_file(error.path), 1)
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
            from boltpose.cell.fill import did_you_mean

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


def _near_file(path: Path) -> str:
    """Return ` (did you mean 'scan.zdf'?)` where a path is one slip away from one that exists.

    Another number is no slip: `scan_0041.zdf` is another clamping than `scan_0040.zdf`.
    """
    from boltpose.cell.fill import did_you_mean

    try:
        missing = path
        while not missing.parent.exists():
            missing = missing.parent
        rest = path.relative_to(missing)
        numbers = re.findall(r"\d+", missing.name)
        near = sorted(
            entry.name
            for entry in missing.parent.iterdir()
            if re.findall(r"\d+", entry.name) == numbers and (entry / rest).exists()
        )
        return "" if missing.exists() else did_you_mean(missing.name, near)
    except OSError:  # a folder we may not look into, a name that is too long
        return ""
