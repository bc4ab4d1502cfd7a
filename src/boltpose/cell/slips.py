"""What was likely meant by a name that is not known, or a file that is not there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from boltpose.errors import InputFileError


def did_you_mean(name: str, known: Sequence[str]) -> str:
    """Return ` (did you mean 'x'?)` for a slip of the keyboard, or nothing."""
    near = get_close_matches(name, known, n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def tell_file_error(error: InputFileError) -> str:
    """Return the text of an error, with the file of nearly that name where there is one."""
    if not error.found.startswith("no "):  # it is there, or is an output
        return str(error)
    return str(error).replace(error.found, error.found + _near_file(error.path), 1)


def _near_file(path: Path) -> str:
    """Return ` (did you mean 'scan.zdf'?)` where a path is one slip away from one that exists.

    Another number is no slip: `scan_0041.zdf` is another clamping than `scan_0040.zdf`.
    """
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
