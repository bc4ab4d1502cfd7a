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
    scans: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCAN...",
            help="A view: .ply .pcd .zdf .npz or a depth .png; several are of one clamping.",
        ),
    ],
    prior: Annotated[
        Path,
        typer.Option(
            "--prior",
            metavar="FILE|DIR",
            help="The motor's .prior.npz, or a folder of them: which motor is it?",
        ),
    ],
    hand_eye: Annotated[
        list[Path] | None,
        typer.Option(
            "--hand-eye",
            metavar="FILE",
            help="base_from_camera, 4x4; with --robot-pose flange_from_camera. Once per scan.",
        ),
    ] = None,
    robot_pose: Annotated[
        list[Path] | None,
        typer.Option(
            "--robot-pose",
            metavar="FILE",
            help="base_from_flange, for a camera on the arm. Once per scan.",
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
    hand_eye_sigma: Annotated[
        str | None,
        typer.Option(
            "--hand-eye-sigma",
            metavar="MM,DEG",
            help="1 sigma of the hand-eye, for the stated uncertainty; else from its residuals.",
        ),
    ] = None,
    tool_tolerance: Annotated[
        str | None,
        typer.Option(
            "--tool-tolerance",
            metavar="MM[,MM[,DEG]]",
            help="How far beside, along and askew the tool still grips: p_tool_fits per bolt.",
        ),
    ] = None,
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
    hand_eyes, robot_poses = hand_eye or [], robot_pose or []
    inputs = (*scans, prior, *hand_eyes, *robot_poses, camera)
    check_output(output, POSES_SUFFIXES, inputs=inputs)
    check_output(picture, PICTURE_SUFFIXES, inputs=(*inputs, output))
    remove_stale(output, picture)

    from boltpose.cli.locate_call import call_locate
    from boltpose.cli.locate_inputs import hash_inputs, parse_sigma, parse_tool, read_shots
    from boltpose.locate_config import LocateConfig
    from boltpose.registration.config import RegistrationConfig
    from boltpose.results import dump_json, write_poses
    from boltpose.segmentation.models import load_models

    config = LocateConfig(
        registration=RegistrationConfig(
            method="paper" if method is Method.PAPER else "multi_start"
        ),
        label_scan=picture is not None,
        tool=parse_tool(tool_tolerance),
    )
    shots = read_shots(
        scans,
        hand_eyes,
        robot_poses,
        scan_unit=scan_unit,
        hand_eye_unit=hand_eye_unit,
        camera=camera,
        sigma=parse_sigma(hand_eye_sigma),
    )
    networks = load_models(models)
    provenance = {
        **hash_inputs(scans, prior, hand_eyes, robot_poses, scan_unit=scan_unit, camera=camera),
        "models": dict(networks.hashes),
    }
    with StageProgress("locating", quiet=as_json) as progress:
        call = call_locate(shots, prior, networks.scene, config, provenance, progress.done)
    result = call.result
    timings_ms = {stage: 1000 * seconds for stage, seconds in progress.seconds.items()}
    if picture is not None:
        from boltpose.picture import draw_located

        draw_located(picture, result, call.scan, call.prior, result.base_from_camera)
    if output is not None:
        write_poses(output, result, timings_ms)
    if result.base_from_camera is None:
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
