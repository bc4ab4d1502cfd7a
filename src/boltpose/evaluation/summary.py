"""The same results in short, for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from boltpose.evaluation.records import MotorRecord
from boltpose.evaluation.targets import judge_targets


def cli_summary(records: Sequence[MotorRecord]) -> Table:
    """Every target, what was measured, met or not, as a table to print.

    Args:
        records: One per motor.

    Returns:
        A rich table.
    """
    table = Table(title=f"reman18 (simulated), leave-one-family-out, {len(records)} motors")
    for name in ("what", "target", "measured", ""):
        table.add_column(name)
    said = {True: "[green]met", False: "[red]not met", None: "not measured"}
    for target in judge_targets(records):
        table.add_row(target.name, target.wanted, target.measured, said[target.is_met])
    return table
