"""Records of `evaluate --priors-only` as tables: Markdown for the report, rich for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from boltpose.evaluation.priors import RIGHT_MM, MotorPrior, PriorsRecord, score_priors
from boltpose.evaluation.tables import markdown_table

_HEADER = (
    "networks",
    "motors",
    "bolts",
    "recall",
    "precision",
    "found and sure",
    "sure, but no bolt",
    f"sure, but more than {RIGHT_MM:g} mm beside",
    "worst lateral, sure, mm",
    "wrong side",
)


def render_priors(records: Sequence[PriorsRecord]) -> str:
    """Lay out what networks that differ in their training find, one row each.

    Args:
        records: One per set of networks.

    Returns:
        Markdown; empty without records.
    """
    if not records:
        return ""
    return "\n\n".join(
        [
            "Priors alone (`boltpose evaluate --priors-only`): the same matching and the same "
            "shipped settings; what differs is what the networks were trained on.",
            markdown_table(_HEADER, [_row(record) for record in records]),
            *[
                f"*{name_priors(record)}*: {slips}."
                for record in records
                if (slips := _slips(record))
            ],
        ]
    )


def priors_summary(record: PriorsRecord) -> Table:
    """Lay out the scores of one record for a terminal."""
    table = Table(title=f"priors of {record.data}, simulated", show_header=False)
    for name, value in zip(_HEADER, _row(record), strict=True):
        table.add_row(name, value)
    if slips := _slips(record):
        table.add_row("what went wrong", slips)
    return table


def _row(record: PriorsRecord) -> tuple[str, ...]:
    scores = score_priors(record)
    return (
        name_priors(record),
        str(len(record.motors)),
        str(scores.true_bolts),
        _share(scores.found, scores.true_bolts),
        _share(scores.found, scores.found + scores.false),
        _share(scores.sure, scores.true_bolts),
        str(scores.sure_false),
        str(scores.sure_misplaced),
        f"{scores.worst_sure_mm:.2f}",
        str(scores.wrong_side),
    )


def name_priors(record: PriorsRecord) -> str:
    """Name the networks and the data of a record."""
    kind = "leave-one-family-out" if record.is_leave_out else record.networks.rsplit("/", 1)[-1]
    return f"{kind}, on {record.data.rsplit('/', 1)[-1]}"


def _slips(record: PriorsRecord) -> str:
    """What was missed or made up, motor by motor."""
    found = [slip for motor in record.motors if (slip := _slips_of(motor))]
    return "; ".join(found)


def _slips_of(motor: MotorPrior) -> str:
    if motor.prior.problem:
        return f"{motor.motor} has no prior ({motor.prior.problem})"
    bolts = motor.prior.bolts
    said = [f"missed bolt {number}" for number in bolts.missed]
    said += [
        f"{bolt.found_id} is none ({'sure' if bolt.is_sure else 'unsure'})" for bolt in bolts.false
    ]
    said += [
        f"{match.found_id} is sure and {match.error.lateral_mm:.2f} mm beside"
        for match in bolts.matches
        if match.is_sure and match.error.lateral_mm > RIGHT_MM
    ]
    return f"{motor.motor} {', '.join(said)}" if said else ""


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole}, {100 * part / whole:.1f} %" if whole else "-"
