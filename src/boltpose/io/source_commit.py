"""Which commit a result comes from."""

from __future__ import annotations

import subprocess
from pathlib import Path

import boltpose


def source_commit() -> str:
    """Git commit of this source tree, with `+` if it differs from it; empty outside of one."""
    package = Path(boltpose.__file__).parent

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(package), *arguments], capture_output=True, text=True, check=True
        ).stdout.strip()

    try:
        commit = git("rev-parse", "--short=12", "HEAD")
        return commit + ("+" if git("status", "--porcelain", "--", ".") else "")
    except (OSError, subprocess.CalledProcessError):
        return ""
