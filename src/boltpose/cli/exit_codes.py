"""What the exit status of `boltpose` tells a calling script."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit status of every command."""

    OK = 0
    """Done; for `locate`: the poses may be used."""
    BAD_INPUT = 2
    """A file or an option cannot be used; one line on stderr says which and why."""
    REFUSED = 3
    """The scan was read but no pose is given; the reasons are in the output."""
    INTERRUPTED = 130
    """Ctrl-C."""
    TERMINATED = 143
    """SIGTERM; files that were being written are gone, as after Ctrl-C."""
