"""`boltpose label`: a class for every point of a scan, in a file that CloudCompare can edit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from boltpose.cli.console import StageProgress, answer_console, answer_json, note, note_aside
from boltpose.cli.options import LengthUnit, ModelsOption
from boltpose.cli.outputs import check_output
from boltpose.errors import ConfigError

if TYPE_CHECKING:
    from boltpose.arrays import Float32Array, UInt8Array
    from boltpose.io.scan import RawScan

_SUFFIXES = (".ply", ".pcd")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Answer:
    """What is to be written beside the points; rows as in the file, 0 for holes."""

    labels: UInt8Array
    confidence: Float32Array | None = None
    probabilities: Float32Array | None = None


def label_scan(
    scan: Annotated[
        Path,
        typer.Argument(
            metavar="SCAN",
            help="Complete scan (.ply .pcd .zdf .npz); with --scene one view, also a depth .png.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="A .ply or .pcd; by default NAME_labelled.ply beside the scan.",
        ),
    ] = None,
    models: ModelsOption = None,
    scene: Annotated[
        bool,
        typer.Option(
            "--scene", help="SCAN is one view: tell the motor (1) from its surroundings (0)."
        ),
    ] = False,
    colours: Annotated[
        bool,
        typer.Option(
            "--colours/--no-colours",
            help="Paint the points by class; without, they keep the colours of the scan.",
        ),
    ] = True,
    probability: Annotated[
        bool,
        typer.Option("--probability", help="Write the probability of every class too."),
    ] = False,
    from_colours: Annotated[
        bool,
        typer.Option(
            "--from-colours", help="No network: take the labels from the palette's colours."
        ),
    ] = False,
    to_colours: Annotated[
        bool,
        typer.Option(
            "--to-colours", help="No network: paint the points by the labels SCAN carries."
        ),
    ] = False,
    scan_unit: Annotated[
        LengthUnit, typer.Option("--scan-unit", help="Unit of the scan; never guessed.")
    ] = LengthUnit.MM,
    camera: Annotated[
        Path | None,
        typer.Option("--camera", metavar="JSON", help="scene_camera.json of a depth .png."),
    ] = None,
) -> None:
    """Label the points of a scan, to correct them in CloudCompare and train on them."""
    if from_colours and to_colours:
        raise ConfigError("--from-colours and --to-colours exclude each other")
    converts = from_colours or to_colours
    asks_network = [
        name
        for name, is_set in (
            ("--scene", scene),
            ("--probability", probability),
            ("--models", models is not None),
        )
        if is_set
    ]
    if converts and asks_network:
        given = "--from-colours" if from_colours else "--to-colours"
        raise ConfigError(f"{asks_network[0]} is about networks, {given} uses none")
    target = scan.with_name(f"{scan.stem}_labelled.ply") if output is None else output
    check_output(target, _SUFFIXES, inputs=(scan, camera))

    from boltpose.io.label_files import labels_of_rows, write_labelled_scan
    from boltpose.io.palette import colors_of_labels
    from boltpose.io.scan import read_raw_scan

    every = read_raw_scan(scan, unit=scan_unit, camera=camera)
    with StageProgress("labelling") as progress:
        if converts:
            answer = _Answer(labels=labels_of_rows(every, from_colors=from_colours))
        else:
            answer = _ask_network(every, models, is_scene=scene, progress=progress)
    scalars: dict[str, Float32Array] = {}
    if answer.confidence is not None:
        scalars["confidence"] = answer.confidence
    if probability and answer.probabilities is not None:
        scalars |= _named_probabilities(answer.probabilities, is_scene=scene)
    write_labelled_scan(
        target,
        every.raw.points,
        answer.labels,
        unit=every.unit,
        colors=colors_of_labels(answer.labels) if colours else every.raw.colors,
        normals=every.raw.normals,
        scalars=scalars,
        grid_shape=every.raw.grid_shape,
    )
    _report(every, answer, target, is_scene=scene)
    if not converts:
        note_aside(progress.summary())


def _ask_network(
    every: RawScan, models: Path | None, *, is_scene: bool, progress: StageProgress
) -> _Answer:
    """Let the networks label the points; holes get label 0 and confidence 0."""
    from time import perf_counter

    import numpy as np

    from boltpose.segmentation.full_scan import label_full_scan
    from boltpose.segmentation.models import load_models

    networks = load_models(models)
    start = perf_counter()
    if is_scene:
        on_motor = networks.scene.predict(every.points_mm)
        found = np.stack([1 - on_motor, on_motor], axis=1)
        first_label = 0
    else:
        found = label_full_scan(
            every.points_mm, networks.parts, source=str(every.path)
        ).probabilities
        first_label = 1
    progress.done("segmentation", perf_counter() - start)
    probabilities = np.zeros((len(every.is_valid), found.shape[1]), dtype=np.float32)
    probabilities[every.is_valid] = found
    labels = np.zeros(len(every.is_valid), dtype=np.uint8)
    labels[every.is_valid] = found.argmax(axis=1) + first_label
    return _Answer(labels=labels, confidence=probabilities.max(axis=1), probabilities=probabilities)


def _named_probabilities(probabilities: Float32Array, *, is_scene: bool) -> dict[str, Float32Array]:
    """Name one field per class; of a view one says all."""
    from boltpose.segmentation.predictor import PARTS

    if is_scene:
        return {"p_motor": probabilities[:, 1]}
    return {f"p_{part.name.lower()}": probabilities[:, i] for i, part in enumerate(PARTS)}


def _report(every: RawScan, answer: _Answer, target: Path, *, is_scene: bool) -> None:
    """Say how many points have which class, and where to look."""
    import numpy as np

    from boltpose.cli.label_table import describe_labels

    confidence = None if answer.confidence is None else answer.confidence[every.is_valid]
    found, counts = np.unique(answer.labels[every.is_valid], return_counts=True)
    points = {str(label): int(count) for label, count in zip(found, counts, strict=True)}
    answer_json({"file": str(target), "points_by_label": points})
    answer_console().print(
        describe_labels(answer.labels[every.is_valid], confidence, is_scene=is_scene)
    )
    note(f"wrote {target}")
