"""`boltpose reproduce`: the paper's study of networks, run by run, and its tables."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from boltpose.cli.console import OUTPUT, note
from boltpose.cli.options import JsonOption
from boltpose.cli.outputs import PICTURE_SUFFIXES, check_folder, check_output
from boltpose.errors import InputFileError, MissingExtraError

if TYPE_CHECKING:
    from boltpose.evaluation.study_settings import DataMark


class Table(StrEnum):
    """What can be reproduced; of networks as `evaluation.study_rows` knows it (a test compares)."""

    TABLE1 = "table1"
    TABLE2 = "table2"
    TABLE3 = "table3"
    BINARY = "binary"
    CURVE = "curve"
    HONEST = "honest"
    ALL = "all"


class BudgetName(StrEnum):
    """Names of budgets, as `boltpose.evaluation.study_rows` knows them (a test compares)."""

    QUICK = "quick"
    STUDY = "study"


def reproduce(
    table: Annotated[
        Table,
        typer.Argument(
            metavar="TABLE",
            help="The paper's table 1, registration (needs the extra `bench`; takes --data, --out, "
            "--work); its tables 2 and 3 and binary segmentation; curve: scores against the "
            "budget; honest: table 2 by leaving out one family; all: what is of networks.",
        ),
    ],
    data: Annotated[
        Path, typer.Option("--data", metavar="DIR", help="The data set, a folder like reman18.")
    ] = Path("data/reman18"),
    synthetic: Annotated[
        Path | None,
        typer.Option(
            "--synthetic", metavar="DIR", help="Pretraining: motors of `boltpose synth motors`."
        ),
    ] = None,
    synthetic_scenes: Annotated[
        Path | None,
        typer.Option(
            "--synthetic-scenes",
            metavar="DIR",
            help="Pretraining of `binary`: scenes of `boltpose synth scenes`.",
        ),
    ] = None,
    budget: Annotated[
        BudgetName,
        typer.Option("--budget", help="quick does everything once and says nothing."),
    ] = BudgetName.STUDY,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="One JSON file per run, resumable. By default results/study, with the quick "
            "budget runs/study-quick/results.",
        ),
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option(
            "--work",
            metavar="DIR",
            help="Networks and checkpoints. By default runs/study or runs/study-quick.",
        ),
    ] = None,
    cache: Annotated[
        Path, typer.Option("--cache", metavar="DIR", help="Features of --data.")
    ] = Path("runs/training"),
    synthetic_cache: Annotated[
        Path | None,
        typer.Option(
            "--synthetic-cache",
            metavar="DIR",
            help="Features of --synthetic. By default cache_synthetic in --work.",
        ),
    ] = None,
    scenes_cache: Annotated[
        Path | None,
        typer.Option(
            "--scenes-cache",
            metavar="DIR",
            help="Features of --synthetic-scenes. By default cache_scenes in --work.",
        ),
    ] = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers",
            min=1,
            metavar="N",
            help="Processes that compute features. To train on two cores, start the command twice.",
        ),
    ] = 1,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="ROW", help="Only this row; may be repeated."),
    ] = None,
    redo: Annotated[
        bool, typer.Option("--redo", help="Run again what was run with other settings.")
    ] = False,
    report_only: Annotated[
        bool, typer.Option("--report-only", help="Run nothing, print the tables of what is there.")
    ] = False,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE", help="Draw the curve: .png, .svg or .pdf."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Train and test the paper's networks, resumable run by run; several processes may share."""
    check_output(picture, PICTURE_SUFFIXES)
    if table is Table.TABLE1:
        _reproduce_table1(data, out, work, report_only=report_only, as_json=as_json)
        return

    from boltpose.evaluation.study_records import read_study_records
    from boltpose.evaluation.study_rows import TABLES
    from boltpose.evaluation.study_tables import render_study, study_as_json

    folder = Path("runs/study-quick") if budget is BudgetName.QUICK else Path("runs/study")
    work = work or folder
    if out is None:
        out = folder / "results" if budget is BudgetName.QUICK else Path("results/study")
    tables = TABLES if table is Table.ALL else (table.value,)
    if not report_only:
        check_folder(out, "the records")
        check_folder(work, "the networks")
        sources = _Sources(
            data=data,
            cache=cache,
            synthetic=synthetic,
            synthetic_cache=synthetic_cache or work / "cache_synthetic",
            scenes=synthetic_scenes,
            scenes_cache=scenes_cache or work / "cache_scenes",
            workers=workers,
        )
        OUTPUT.interruption = "interrupted; finished runs are kept, the same command goes on"
        _run(table.value, tables, sources, budget.value, out, work, only or [], redo=redo)
    records = read_study_records(out)
    if not records:
        raise InputFileError(out, "no record of a run", "the folder reproduce wrote to")
    if picture is not None:
        from boltpose.evaluation.study_curve import draw_curve

        draw_curve(records, picture)
        note(f"wrote {picture}")
    if as_json:
        typer.echo(json.dumps(study_as_json(records, tables), indent=1))
    else:
        # plain: a console would wrap the rows of the tables
        typer.echo(render_study(records, tables=tables))


def _reproduce_table1(
    data: Path, out: Path | None, work: Path | None, *, report_only: bool, as_json: bool
) -> None:
    from boltpose.cli.study_progress import MotorProgress
    from boltpose.evaluation.table1_report import render_table1
    from boltpose.evaluation.table1_run import FOLDER, run_table1

    out = out or Path("results") / FOLDER
    if not report_only:
        check_folder(out, "the records")
        OUTPUT.interruption = "interrupted; finished motors are kept, the same command goes on"
        with MotorProgress("table 1") as progress:
            run_table1(data, (work or Path("runs")) / FOLDER, out, on_motor=progress.done)
    text = render_table1(out)
    if not text:
        raise InputFileError(out, "no record of a motor", "the folder reproduce table1 wrote to")
    table = "\n\n".join(text)
    typer.echo(json.dumps({"markdown": table}) if as_json else table)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sources:
    """Data sets and where their features are kept."""

    data: Path
    cache: Path
    synthetic: Path | None
    synthetic_cache: Path
    scenes: Path | None
    scenes_cache: Path
    workers: int


def _run(
    title: str,
    tables: Sequence[str],
    sources: _Sources,
    budget: str,
    out: Path,
    work: Path,
    only: Sequence[str],
    *,
    redo: bool,
) -> None:
    """Do what is not done yet."""
    try:
        from boltpose.cli.study_trainer import PlainTrainer
        from boltpose.training.study import StudyData
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.split(".")[0] == "boltpose":
            raise
        raise MissingExtraError(str(error.name), "train") from error
    from boltpose.cli.study_progress import StudyProgress
    from boltpose.datasets.reman18 import Reman18
    from boltpose.evaluation.study_plan import plan_study
    from boltpose.evaluation.study_rows import BUDGETS
    from boltpose.evaluation.study_run import StudyEvents, run_study
    from boltpose.evaluation.study_settings import mark_data

    found: dict[str, StudyData] = {}

    def mark(root: Path, cache: Path) -> DataMark:
        marked = mark_data(root)
        found[marked.digest] = StudyData(motors=Reman18(root=root), cache=cache)
        return marked

    def mark_if_given(root: Path | None, cache: Path) -> DataMark | None:
        return None if root is None else mark(root, cache)

    own = mark(sources.data, sources.cache)
    motors = found[own.digest].motors
    runs = plan_study(
        tables,
        {motor: motors.family(motor) for motor in motors.motors},
        BUDGETS[budget],
        data=own,
        synthetic=mark_if_given(sources.synthetic, sources.synthetic_cache),
        scenes=mark_if_given(sources.scenes, sources.scenes_cache),
        only=only,
    )
    trainer = PlainTrainer(found, workers=sources.workers)
    with StudyProgress(title, len(runs)) as progress:
        events = StudyEvents(on_step=progress.step, on_run=progress.run, on_wait=progress.wait)
        run_study(runs, trainer, out=out, work=work, redo=redo, events=events)
