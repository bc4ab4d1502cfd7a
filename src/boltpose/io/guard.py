"""Whatever is wrong with a file becomes one `InputFileError`."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from boltpose.errors import InputFileError

MAX_POINTS = 50_000_000
"""Ten times the largest scan we promise to read; a header that claims more is broken."""

_LONGEST_REASON = 160


def require_file(path: str | Path, wanted: str) -> Path:
    """Check that a path is a readable file that is not empty.

    Args:
        path: What the user gave.
        wanted: What the caller needs, for the error text.

    Returns:
        The path.

    Raises:
        InputFileError: It is missing, a folder, empty or may not be read.
    """
    file = Path(path)
    with refusing(file, wanted):
        if not file.exists():
            raise InputFileError(file, "no such file", wanted)
        if not file.is_file():
            raise InputFileError(file, "a folder" if file.is_dir() else "no plain file", wanted)
        with file.open("rb") as stream:
            if not stream.read(1):
                raise InputFileError(file, "an empty file", wanted)
    return file


@contextmanager
def refusing(path: str | Path, wanted: str) -> Generator[None]:
    """Turn any exception of a parser into an `InputFileError` about its file.

    Parsers of broken files raise nearly everything: h5py `OSError`, `KeyError` and
    `RuntimeError`, Pillow `SyntaxError`, numpy `MemoryError`. The cause is kept as `__cause__`.

    Args:
        path: The file being read.
        wanted: What the reader accepts, for the error text.

    Raises:
        InputFileError: The body raised anything.
    """
    try:
        yield
    except InputFileError:
        raise
    except Exception as error:
        raise InputFileError(path, f"unreadable content ({_reason(error)})", wanted) from error


def _reason(error: Exception) -> str:
    """Say in one short line what a parser complained about."""
    text = " ".join(str(error).split()) or "no reason given"
    if len(text) > _LONGEST_REASON:
        text = text[: _LONGEST_REASON - 3] + "..."
    return f"{type(error).__name__}: {text}"
