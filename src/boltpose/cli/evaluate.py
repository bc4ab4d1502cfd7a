"""`boltpose evaluate`: the numbers in docs/results.md, from data to table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import OUTPUT, answer_console, answer_json, note, note_console
from boltpose.cli.outputs import check_output

REPORT_SUFFIXES = (".md",)
PRIORS_SUFFIXES = (".json",)


def evaluate(
    data: Annotated[
        Path, typer.Option("--data", metavar="DIR", help="The data set, a folder like reman18.")
    ] = Path("data/reman18"),
    models: Annotated[
        Path,
        typer.Option("--models", metavar="DIR", help="Networks trained without each family."),
    ] = Path("data/models"),
    records: Annotated[
        Path, typer.Option("--records", metavar="DIR", help="One JSON file per motor, resumable.")
    ] = Path("results/evaluate"),
    report: Annotated[
        Path, typer.Option("--report", metavar="MD", help="The tables are written here.")
    ] = Path("docs/results.md"),
    motors: Annotated[
        list[str] | None,
        typer.Option("--motor", metavar="NAME", help="Only this motor; may be repeated."),
    ] = None,
    report_only: Annotated[
        bool, typer.Option("--report-only", help="Measure nothing, write the tables again.")
    ] = False,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Measure again what is measured already.")
    ] = False,
    priors_only: Annotated[
        Path | None,
        typer.Option(
            "--priors-only",
            metavar="JSON",
            help="Build the priors only, tell what was found and write it here; --models may then "
            "be one folder of networks for all motors.",
        ),
    ] = None,
) -> None:
    """Evaluate on labelled data, every motor by networks that saw none of its family."""
    check_output(report, REPORT_SUFFIXES)
    check_output(priors_only, PRIORS_SUFFIXES)
    if priors_only is not None:
        _evaluate_priors(data, models, motors, priors_only)
        return

    from boltpose.evaluation.calibration_report import report_calibration
    from boltpose.evaluation.foreign import read_foreign, render_foreign
    from boltpose.evaluation.report import render_report, write_report
    from boltpose.evaluation.run import evaluate as run_evaluation
    from boltpose.evaluation.run import read_records
    from boltpose.evaluation.study_records import read_study_records
    from boltpose.evaluation.study_tables import render_study
    from boltpose.evaluation.summary import cli_summary
    from boltpose.evaluation.trust_report import draw_trust, trust_sections

    if not report_only:
        OUTPUT.interruption = "interrupted; finished motors are kept, the same command goes on"
        run_evaluation(
            data, models, records, motors=motors, resume=not fresh, console=note_console()
        )
    measured = read_records(records)
    foreign_report = records.parent / "foreign" / "report.json"
    foreign = render_foreign(read_foreign(foreign_report)) if foreign_report.exists() else ""
    curve = "images/learning_curve.png"
    study = render_study(
        read_study_records(records.parent / "study"),
        picture=curve if (report.parent / curve).exists() else "",
    )
    priors, calibration = report_calibration(records.parent, report)
    text = render_report(
        measured,
        foreign=foreign,
        study=study,
        priors=priors,
        calibration=calibration,
        trust=trust_sections(records.parent),
    )
    draw_trust(records.parent, report)
    write_report(report, text)
    answer_json({"report": str(report), "motors": len(measured)})
    answer_console().print(cli_summary(measured))
    note(f"wrote {report}")


def _evaluate_priors(data: Path, models: Path, motors: list[str] | None, out: Path) -> None:
    from boltpose.evaluation.prior_tables import priors_summary
    from boltpose.evaluation.priors import evaluate_priors, write_priors

    record = evaluate_priors(data, models, motors=motors, console=note_console())
    write_priors(out, record)
    answer_json({"priors": str(out)})
    answer_console().print(priors_summary(record))
    note(f"wrote {out}")
