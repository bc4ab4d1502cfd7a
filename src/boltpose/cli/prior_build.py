"""`boltpose prior build`: full scan or CAD mesh -> prior, once per motor."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import StageProgress, answer_console, note, note_aside
from boltpose.cli.options import JsonOption, LengthUnit, ModelsOption, PictureOption
from boltpose.cli.outputs import PICTURE_SUFFIXES, PRIOR_SUFFIXES, check_output


def build(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SCAN_OR_MESH",
            help="Complete scan (.ply .pcd .zdf .npz) or CAD mesh (.stl .obj .ply .glb).",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The prior: NAME.prior.npz.")
    ],
    unit: Annotated[
        LengthUnit | None,
        typer.Option("--unit", help="Unit of the file; by default mm, metres for .glb."),
    ] = None,
    parts: Annotated[
        Path | None,
        typer.Option(
            "--parts",
            metavar="YAML",
            help="Class of each named part of a mesh; no network is needed then.",
        ),
    ] = None,
    use_labels: Annotated[
        bool,
        typer.Option("--use-labels", help="Trust the labels in the scan file; no network."),
    ] = False,
    name: Annotated[
        str | None,
        typer.Option("--name", help="What the motor is called; by default the output's name."),
    ] = None,
    picture: PictureOption = None,
    models: ModelsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Build the prior of a motor from its complete scan or its CAD mesh."""
    inputs = (source, parts)
    check_output(output, PRIOR_SUFFIXES, inputs=inputs)
    check_output(picture, PICTURE_SUFFIXES, inputs=(*inputs, output))

    from boltpose.io.digest import sha256_of
    from boltpose.io.full_scan import read_full_scan
    from boltpose.prior.build import BuildConfig, build_prior
    from boltpose.prior.file import prior_to_json, write_prior
    from boltpose.segmentation.models import load_models

    scan = read_full_scan(source, unit=unit, parts=parts, needs_labels=use_labels)
    takes_file_labels = use_labels or parts is not None
    networks = None if takes_file_labels else load_models(models)
    with StageProgress("building the prior", quiet=as_json) as progress:
        prior = build_prior(
            scan,
            None if networks is None else networks.parts,
            BuildConfig(use_file_labels=takes_file_labels),
            name=name or output.name.removesuffix(".npz").removesuffix(".prior"),
            provenance={
                "source": source.name,
                "source_sha256": sha256_of(source),
                "models": {} if networks is None else dict(networks.hashes),
            },
            on_stage=progress.done,
        )
    if picture is not None:
        from boltpose.picture import draw_prior

        draw_prior(picture, prior)
    write_prior(output, prior)
    if as_json:
        typer.echo(json.dumps(prior_to_json(prior), indent=2))
        return
    from boltpose.cli.tables import describe_prior

    answer_console().print(describe_prior(prior))
    note_aside(progress.summary())
    note(f"wrote {output}")
