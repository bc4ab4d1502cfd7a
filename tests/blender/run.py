"""Run the Blender tests: `python -m tests.blender.run`; the exit code is theirs."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest


def main() -> None:
    """Blender as a module hangs when Python ends, so the process ends without asking it."""
    folder = Path(__file__).parent
    code = pytest.main(
        ["-c", str(folder / "pytest.ini"), "-p", "no:cacheprovider", str(folder), *sys.argv[1:]]
    )
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(int(code))


if __name__ == "__main__":
    main()
