"""`boltpose locate`: the production call, one scan to every bolt in the robot's frame."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import StageProgress, answer_console, note_console, warn
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.options import JsonOption, LengthUnit, ModelsOption, PictureOption
from boltpose.cli.outputs import PICTURE_SUFFIXES, POSES_SUFFIXES, check_output, remove_stale


class Method(StrEnum):
    """Registration methods by the name a user knows them by."""

    DEFAULT = "default"
    PAPER = "paper"


def locate_bolts(
    scan: Annotated[
        Path,
        typer.Argument(metavar="SCAN", help="One view: .ply .pcd .zdf .npz or a depth .png."),
    ],
    prior: Annotated[Path, typer.Option("--prior", metavar="FILE", help="The motor's .prior.npz.")],
    hand_eye: Annotated[
        Path | None,
        typer.Option(
            "--hand-eye",
            metavar="FILE",
            help="base_from_camera, 4x4; with --robot-pose flange_from_camera.",
        ),
    ] = None,
    robot_pose: Annotated[
        Path | None,
        typer.Option(
            "--robot-pose", metavar="FILE", help="base_from_flange, for a camera on the arm."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write poses.json here.")
    ] = None,
    picture: PictureOption = None,
    as_json: JsonOption = False,
    scan_unit: Annotated[
        LengthUnit, typer.Option("--scan-unit", help="Unit of the scan; never guessed.")
    ] = LengthUnit.MM,
    hand_eye_unit: Annotated[
        LengthUnit,
        typer.Option("--hand-eye-unit", help="Unit of the hand-eye matrix and the robot pose."),
    ] = LengthUnit.MM,
    camera: Annotated[
        Path | None,
        typer.Option("--camera", metavar="JSON", help="scene_camera.json of a depth .png."),
    ] = None,
    method: Annotated[
        Method,
        typer.Option("--method", help="Registration; `paper` needs the `bench` extra."),
    ] = Method.DEFAULT,
    models: ModelsOption = None,
) -> None:
    """Locate every bolt of a clamped motor, also those the camera cannot see."""
    inputs = (scan, prior, hand_eye, robot_pose, camera)
    check_output(output, POSES_SUFFIXES, inputs=inputs)
    check_output(picture, PICTURE_SUFFIXES, inputs=(*inputs, output))
    remove_stale(output, picture)

    from boltpose.cli.load import read_base_from_camera, sha256_of
    from boltpose.io.scan import read_scan
    from boltpose.locate import LocateConfig, locate
    from boltpose.prior.file import read_prior
    from boltpose.registration.config import RegistrationConfig
    from boltpose.results import dump_json, write_poses
    from boltpose.segmentation.models import load_models

    known = read_prior(prior)
    base_from_camera = read_base_from_camera(hand_eye, robot_pose, hand_eye_unit)
    view = read_scan(scan, unit=scan_unit, camera=camera)
    networks = load_models(models)
    registration = RegistrationConfig(
        method="paper" if method is Method.PAPER else "multi_start",
    )
    with StageProgress("locating", quiet=as_json) as progress:
        result = locate(
            view,
            known,
            base_from_camera,
            networks.scene,
            LocateConfig(registration=registration, label_scan=picture is not None),
            provenance={
                "scan": scan.name,
                "scan_sha256": sha256_of(scan),
                "prior_sha256": sha256_of(prior),
                "hand_eye_sha256": None if hand_eye is None else sha256_of(hand_eye),
                "robot_pose_sha256": None if robot_pose is None else sha256_of(robot_pose),
                "models": dict(networks.hashes),
            },
            on_stage=progress.done,
        )
    timings_ms = {stage: 1000 * seconds for stage, seconds in progress.seconds.items()}
    if picture is not None:
        from boltpose.picture import draw_located

        draw_located(picture, result, view, known, base_from_camera)
    if output is not None:
        write_poses(output, result, timings_ms)
    if base_from_camera is None:
        warn("no --hand-eye: poses are in frame 'camera', NOT in the robot's base")
    if as_json:
        typer.echo(dump_json(result, timings_ms), nl=False)
    else:
        from boltpose.cli.tables import describe_result

        answer_console().print(describe_result(result))
        note_console().print(f"[dim]{progress.summary()}[/]", soft_wrap=True)
        for path in (output, picture):
            if path is not None:
                note_console().print(f"wrote {path}", soft_wrap=True)
    if not result.is_ok:
        raise typer.Exit(ExitCode.REFUSED)
