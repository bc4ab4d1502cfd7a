"""`boltpose locate`: the production call, one scan to every bolt in the robot's frame."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.cell import ConfigOption, open_cell
from boltpose.cli.console import StageProgress, answer_console, note, note_aside, warn
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.locate_settings import Method, settle
from boltpose.cli.options import JsonOption, LengthUnit, ModelsOption, PictureOption
from boltpose.cli.outputs import (
    PICTURE_SUFFIXES,
    POSES_SUFFIXES,
    REPORT_SUFFIXES,
    check_output,
    check_still_free,
    remove_stale,
    remove_stale_poses,
)
from boltpose.errors import BoltposeError


def locate_bolts(
    scans: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCAN",
            help="A view: .ply .pcd .zdf .npz or a depth .png; several are of one clamping.",
        ),
    ],
    prior: Annotated[
        Path | None,
        typer.Option(
            "--prior",
            metavar="FILE|DIR",
            help="The motor's .prior.npz, or a folder of them: which motor is it?",
        ),
    ] = None,
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
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="A page for people: .html, one A4 sheet."),
    ] = None,
    as_json: JsonOption = False,
    scan_unit: Annotated[
        LengthUnit | None,
        typer.Option("--scan-unit", help="Unit of the scan; mm, never guessed."),
    ] = None,
    hand_eye_unit: Annotated[
        LengthUnit | None,
        typer.Option("--hand-eye-unit", help="Unit of the hand-eye matrix and the robot pose; mm."),
    ] = None,
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
        Method | None,
        typer.Option("--method", help="Registration; `paper` needs the `bench` extra."),
    ] = None,
    max_age: Annotated[
        float | None,
        typer.Option(
            "--max-age",
            metavar="SECONDS",
            help="Refuse a scan or robot pose written longer ago: the camera may have failed.",
        ),
    ] = None,
    models: ModelsOption = None,
    config: ConfigOption = None,
) -> None:
    """Locate every bolt of a clamped motor, also those the camera cannot see."""
    named = (*scans, prior, *(hand_eye or []), *(robot_pose or []), camera)
    check_output(output, POSES_SUFFIXES, inputs=named)
    try:
        cell = open_cell(config)
        given = settle(
            cell.locate(),
            prior=prior,
            hand_eyes=hand_eye or [],
            robot_poses=robot_pose or [],
            scan_unit=scan_unit,
            hand_eye_unit=hand_eye_unit,
            hand_eye_sigma=hand_eye_sigma,
            tool_tolerance=tool_tolerance,
            camera=camera,
            method=method,
            models=models,
            scans=scans,
        )
    except BoltposeError:
        remove_stale_poses(output)
        raise
    inputs = (*scans, given.prior, *given.hand_eyes, *given.robot_poses, given.camera)
    check_output(output, POSES_SUFFIXES, inputs=inputs)
    check_output(picture, PICTURE_SUFFIXES, inputs=(*inputs, output))
    check_output(report, REPORT_SUFFIXES, inputs=(*inputs, output, picture))
    remove_stale(output, picture, report)

    from boltpose.cli.locate_call import call_locate
    from boltpose.cli.locate_inputs import InputStamps, check_age, hash_inputs, read_shots
    from boltpose.locate_config import LocateConfig
    from boltpose.registration.config import RegistrationConfig
    from boltpose.results import dump_json, write_poses
    from boltpose.segmentation.models import load_models

    settings = LocateConfig(
        registration=RegistrationConfig(method=given.registration_method),
        label_scan=picture is not None,
        tool=given.tool,
    )
    check_age((*scans, *given.robot_poses), max_age)
    stamps = InputStamps.of(path for path in inputs if path is not None)
    shots = read_shots(
        scans,
        given.hand_eyes,
        given.robot_poses,
        scan_unit=given.scan_unit,
        hand_eye_unit=given.hand_eye_unit,
        camera=given.camera,
        sigma=given.hand_eye_sigma,
    )
    networks = load_models(given.models)
    provenance = {
        **hash_inputs(
            scans,
            given.prior,
            given.hand_eyes,
            given.robot_poses,
            scan_unit=given.scan_unit,
            camera=given.camera,
        ),
        "models": dict(networks.hashes),
        **cell.provenance(),
    }
    with StageProgress("locating", quiet=as_json) as progress:
        call = call_locate(shots, given.prior, networks.scene, settings, provenance, progress.done)
    stamps.check()
    result = call.result
    timings_ms = {stage: 1000 * seconds for stage, seconds in progress.seconds.items()}
    if picture is not None:
        from boltpose.picture import draw_located

        draw_located(picture, result, call.scan, call.prior, result.base_from_camera)
    if report is not None:
        from boltpose.report import write_report

        write_report(report, result, call.scan, call.prior, timings_ms)
    # last: a robot that waits for it finds everything else in place
    if output is not None:
        check_still_free(output)
        write_poses(output, result, timings_ms)
    if result.base_from_camera is None:
        warn("no --hand-eye: poses are in frame 'camera', NOT in the robot's base")
    if as_json:
        typer.echo(dump_json(result, timings_ms), nl=False)
    else:
        from boltpose.cli.tables import describe_result

        answer_console().print(describe_result(result))
        note_aside(progress.summary())
        for path in (output, picture, report):
            if path is not None:
                note(f"wrote {path}")
    if not result.is_ok:
        raise typer.Exit(ExitCode.REFUSED)
