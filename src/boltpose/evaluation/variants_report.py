"""The section on many priors: which motor is clamped, and what the choice costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from boltpose.evaluation.tables import markdown_table
from boltpose.evaluation.variants_records import (
    VariantCase,
    VariantMotor,
    read_variant_motors,
)
from boltpose.schema import Status
from boltpose.variants import VariantConfig

PICTURE = Path("images") / "variants.png"
"""Relative to the report."""

_HOW = """\
`locate --prior FOLDER` on the views of reman18 (simulated), masks and priors from networks that
have not seen the family. A folder of 18 holds the priors of reman18, three sizes each of six
families; larger ones add motors of the factory (simulated), seeds that nothing was trained on.
*Left out*: the clamped motor's own prior is taken away, its sisters stay; every motor found is
then a wrong one. Folders between the smallest and the largest are tried in the first view of each
motor. CPU seconds of one core, the whole call with reading and preparing priors; the sketches of
the folder are read once, when it is opened. *Against one* divides by `locate` with the right
prior on the same view, its file read and prepared."""


def sections(results: Path) -> list[str]:
    """Render what `results/variants` holds, Markdown; nothing if it holds nothing."""
    motors = read_variant_motors(results / "variants")
    if not motors:
        return []
    return [
        "## Which motor is clamped? Many priors",
        _HOW,
        _table(motors),
        _leads(motors),
        f"![CPU time against the number of priors, and agreement]({PICTURE.as_posix()})",
    ]


def agreement_of(motor: VariantMotor, case: VariantCase) -> tuple[float | None, float | None]:
    """Agreement of the right prior and of the best other one; None where not compared."""
    others = [value for name, value in case.agreements.items() if name != motor.motor]
    return case.agreements.get(motor.motor), max(others, default=None)


def group_cases(
    motors: Sequence[VariantMotor],
) -> dict[tuple[bool, int], list[tuple[VariantMotor, VariantCase]]]:
    """All cases by whether the motor is known, then by the number of priors."""
    groups: dict[tuple[bool, int], list[tuple[VariantMotor, VariantCase]]] = {}
    for motor in motors:
        for case in motor.cases:
            groups.setdefault((case.is_known, case.priors), []).append((motor, case))
    return {key: groups[key] for key in sorted(groups, key=lambda key: (not key[0], key[1]))}


def _table(motors: Sequence[VariantMotor]) -> str:
    rows: list[tuple[str, ...]] = []
    for (is_known, priors), cases in group_cases(motors).items():
        right = sum(motor.is_right(case) for motor, case in cases)
        wrong = sum(motor.is_wrong(case) for motor, case in cases)
        refused = sum(case.status is Status.REFUSED for _, case in cases)
        tries = [len(case.registered) for _, case in cases]
        cpu_s = [case.cpu_s for _, case in cases]
        against = [case.cpu_s / case.one_prior_cpu_s for _, case in cases]
        rows.append(
            (
                f"{priors}" if is_known else f"{priors}, left out",
                f"{len(cases)}",
                f"{right}" if is_known else "-",
                f"{wrong}",
                f"{refused}",
                f"{np.mean(tries):.2f} / {max(tries)}",
                f"{np.median(cpu_s):.2f} / {max(cpu_s):.2f}",
                f"{np.median(against):.2f}",
            )
        )
    return markdown_table(
        (
            "priors",
            "views",
            "right motor, ok",
            "wrong motor, ok",
            "refused",
            "registered in full, mean / max",
            "CPU s, median / max",
            "against one",
        ),
        rows,
    )


def _leads(motors: Sequence[VariantMotor]) -> str:
    pairs = [agreement_of(motor, case) for motor in motors for case in motor.cases if case.is_known]
    right = [own for own, _ in pairs if own is not None]
    others = [other for _, other in pairs if other is not None]
    leads = [own - other for own, other in pairs if own is not None and other is not None]
    bolts = [
        case.worst_bolt_mm
        for motor in motors
        for case in motor.cases
        if case.worst_bolt_mm is not None
    ]
    if not (right and others and leads and bolts):
        return "No right motor was compared with another."
    return (
        f"Agreement of the motor points within 0.5 mm, all priors on the same points: the right "
        f"prior at least {min(right):.2f}, any other at most {max(others):.2f}; the lead is at "
        f"least {min(leads):.2f}, wanted {VariantConfig().min_lead:g}. The worst bolt of all right "
        f"poses is {max(bolts):.2f} mm off."
    )
