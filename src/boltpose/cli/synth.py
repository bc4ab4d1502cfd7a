"""`boltpose synth motors|scenes`: labelled data sets of synthetic motors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from boltpose.cli.console import OUTPUT, answer_json, answer_text, note
from boltpose.cli.outputs import check_folder

if TYPE_CHECKING:
    from boltpose.synthesis.run import MakeSample
    from boltpose.synthesis.settings import DataSetSettings

CountOption = Annotated[
    int, typer.Option("-n", "--count", metavar="N", help="Motors the data set shall have.")
]
SeedOption = Annotated[int, typer.Option("--seed", help="Another seed, other motors.")]
FolderOption = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="The data set; a run resumes there.")
]
WorkersOption = Annotated[
    int,
    typer.Option("--workers", metavar="K", min=1, help="Processes; the bytes do not depend on it."),
]
FamiliesOption = Annotated[
    str | None,
    typer.Option("--families", metavar="A,B", help="Only these; see `boltpose synth families`."),
]
WearOption = Annotated[bool, typer.Option("--wear/--no-wear", help="Rust, dirt, dents, grease.")]
PreviewOption = Annotated[
    bool, typer.Option("--preview", help="Draw contact sheets into the data set at the end.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Compute on this Ray cluster (`auto`, `local` or HOST:PORT); needs `cluster`.",
    ),
]


def synth_motors(
    output: FolderOption,
    count: CountOption = 100,
    seed: SeedOption = 0,
    workers: WorkersOption = 1,
    families: FamiliesOption = None,
    wear: WearOption = True,
    preview: PreviewOption = False,
    cluster: ClusterOption = None,
) -> None:
    """Make full scans of synthetic motors without a clamp, every point labelled."""
    from boltpose.factory.families import FAMILIES
    from boltpose.synthesis.sample import make_motor_sample
    from boltpose.synthesis.settings import DataSetSettings, Kind, choose_names

    settings = DataSetSettings(
        kind=Kind.MOTORS,
        seed=seed,
        families=choose_names(families, FAMILIES, "family"),
        with_wear=wear,
    )
    _run(output, settings, count, make_motor_sample, workers, cluster, preview=preview)


def synth_scenes(
    output: FolderOption,
    count: CountOption = 100,
    views: Annotated[
        int, typer.Option("--views", metavar="V", help="Views per motor, each clamped anew.")
    ] = 2,
    angles: Annotated[
        int,
        typer.Option("--angles", metavar="K", help="Shots of each clamping, from K places."),
    ] = 1,
    seed: SeedOption = 0,
    workers: WorkersOption = 1,
    families: FamiliesOption = None,
    clamps: Annotated[
        str | None, typer.Option("--clamps", metavar="A,B", help="Only these clamp designs.")
    ] = None,
    size: Annotated[
        str, typer.Option("--size", metavar="WxH", help="Pixels of a view.")
    ] = "1224x1024",
    wear: WearOption = True,
    changes: Annotated[
        bool,
        typer.Option("--changes/--no-changes", help="What may happen between scan and clamping."),
    ] = True,
    preview: PreviewOption = False,
    cluster: ClusterOption = None,
) -> None:
    """Make full scans and views of clamped motors, in the layout of reman18."""
    from boltpose.factory.families import FAMILIES
    from boltpose.factory.scene import CLAMPS
    from boltpose.synthesis.scene_sample import make_scene_sample
    from boltpose.synthesis.settings import DataSetSettings, Kind, choose_names, parse_size

    width, height = parse_size(size)
    settings = DataSetSettings(
        kind=Kind.SCENES,
        seed=seed,
        families=choose_names(families, FAMILIES, "family"),
        views=views,
        angles=angles,
        clamps=choose_names(clamps, CLAMPS, "clamp"),
        width_px=width,
        height_px=height,
        with_wear=wear,
        with_changes=changes,
    )
    _run(output, settings, count, make_scene_sample, workers, cluster, preview=preview)


def _run(
    output: Path,
    settings: DataSetSettings,
    count: int,
    make: MakeSample,
    workers: int,
    cluster: str | None,
    *,
    preview: bool,
) -> None:
    check_folder(output, "the data set")

    from functools import partial

    from boltpose.cli.synth_progress import SampleProgress
    from boltpose.synthesis.card import write_card
    from boltpose.synthesis.run import run_data_set, run_local

    if cluster is None:
        run_tasks = partial(run_local, workers=workers)
    else:
        from boltpose.synthesis.cluster import require_ray, run_on_cluster

        require_ray()  # now, not after the folder was made
        run_tasks = partial(run_on_cluster, address=cluster)
    progress = SampleProgress(str(settings.kind))
    OUTPUT.interruption = "interrupted; whole motors are kept, the same command goes on"
    with progress:
        done = run_data_set(
            output,
            settings,
            count,
            make,
            run_tasks,
            on_start=progress.start,
            on_sample=progress.advance,
        )
    if preview:
        from boltpose.synthesis.preview import write_previews

        for path in write_previews(output):
            note(f"wrote {path}")
    card = write_card(output)
    note(f"wrote {card}")
    answer_json({"folder": str(output), "made": done.made, "kept": done.kept})
    answer_text(
        f"{done.made} made, {done.kept} were there; {done.retries} draws made again"
        + (f"; {progress.summary()}" if done.made else "")
    )
