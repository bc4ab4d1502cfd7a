"""`boltpose export-poses`: a result as the file that a robot's controller reads."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from boltpose.cli.cell import ConfigOption, open_cell
from boltpose.cli.console import answer_console, note_console, warn
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.options import JsonOption, LengthUnit
from boltpose.cli.outputs import check_output, remove_stale
from boltpose.errors import ConfigError, PosesRefusedError

if TYPE_CHECKING:
    from boltpose.geometry.transforms import Transform
    from boltpose.results import PosesFile
    from boltpose.robot import RobotConfig, ToolPlan


_POSES = "The poses"
_BOLTS = "Which bolts, in which order"
_ONE_FORMAT = "One format only"


class Target(StrEnum):
    """Formats by the names users know them by (a test compares them with `RobotFormat`)."""

    URSCRIPT = "urscript"
    KUKA = "kuka"
    FANUC = "fanuc"
    ABB = "abb"
    ROS2_MCAP = "ros2-mcap"
    BOP_CSV = "bop-csv"
    CSV = "csv"


def export_poses(
    poses: Annotated[
        Path, typer.Argument(metavar="POSES", help="A poses.json of `boltpose locate`.")
    ],
    to: Annotated[Target, typer.Option("--to", help="Whose format.")],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FILE", help="Programs are called like their file."),
    ],
    approach: Annotated[
        float | None,
        typer.Option(
            "--approach", metavar="MM", help="Out from contact; 50.", rich_help_panel=_POSES
        ),
    ] = None,
    retreat: Annotated[
        float | None,
        typer.Option(
            "--retreat", metavar="MM", help="Out from contact; 50.", rich_help_panel=_POSES
        ),
    ] = None,
    contact_offset: Annotated[
        float | None,
        typer.Option(
            "--contact-offset",
            metavar="MM",
            help="Contact above (+) or below (-) the top of the head; 0.",
            rich_help_panel=_POSES,
        ),
    ] = None,
    tool_x: Annotated[
        str | None,
        typer.Option(
            "--tool-x",
            metavar="DIR",
            help="Where tool x points in the base: +x -x +y -y +z -z outward inward or 1,1,0; +x.",
            rich_help_panel=_POSES,
        ),
    ] = None,
    tcp: Annotated[
        Path | None,
        typer.Option(
            "--tcp",
            metavar="FILE",
            help="flange_from_tool, 4x4: write poses of the flange, not of the tool's tip.",
            rich_help_panel=_POSES,
        ),
    ] = None,
    tcp_unit: Annotated[
        LengthUnit, typer.Option("--tcp-unit", help="Unit of the TCP.", rich_help_panel=_POSES)
    ] = LengthUnit.MM,
    order: Annotated[
        str | None,
        typer.Option(
            "--order",
            metavar="RULE",
            help="Of bolts without a turn in the prior: nearest or confidence; nearest.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    include_hidden: Annotated[
        bool | None,
        typer.Option(
            "--include-hidden/--no-hidden",
            help="Bolts the camera did not see.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    include_unsure: Annotated[
        bool | None,
        typer.Option(
            "--include-unsure/--no-unsure",
            help="Bolts no person has confirmed.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    include_contradicted: Annotated[
        bool | None,
        typer.Option(
            "--include-contradicted",
            help="Where something else than the bolt was seen. Never with a tool!",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    min_confidence: Annotated[
        float | None,
        typer.Option("--min-confidence", metavar="P", help="0 to 1; 0.", rich_help_panel=_BOLTS),
    ] = None,
    min_tool_fits: Annotated[
        float | None,
        typer.Option(
            "--min-tool-fits",
            metavar="P",
            help="Smallest p_tool_fits, 0 to 1.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    max_sigma: Annotated[
        float | None,
        typer.Option(
            "--max-sigma",
            metavar="MM",
            help="Largest sigma beside or along the axis.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    max_sigma_axis: Annotated[
        float | None,
        typer.Option(
            "--max-sigma-axis",
            metavar="DEG",
            help="Largest sigma of the direction.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    max_age: Annotated[
        float | None,
        typer.Option(
            "--max-age",
            metavar="SECONDS",
            help="Refuse a POSES file that is older than this.",
            rich_help_panel=_BOLTS,
        ),
    ] = None,
    first_register: Annotated[
        int | None,
        typer.Option(
            "--first-register",
            metavar="N",
            help="fanuc: fill PR[N] and on, three per bolt.",
            rich_help_panel=_ONE_FORMAT,
        ),
    ] = None,
    count_register: Annotated[
        int | None,
        typer.Option(
            "--count-register",
            metavar="N",
            help="fanuc: put the number of bolts in R[N].",
            rich_help_panel=_ONE_FORMAT,
        ),
    ] = None,
    stamp: Annotated[
        int,
        typer.Option(
            "--stamp",
            metavar="NS",
            help="ros2-mcap: time of the scan, nanoseconds since 1970.",
            rich_help_panel=_ONE_FORMAT,
        ),
    ] = 0,
    scene: Annotated[
        int | None, typer.Option("--scene", help="bop-csv: scene_id.", rich_help_panel=_ONE_FORMAT)
    ] = None,
    image: Annotated[
        int | None, typer.Option("--image", help="bop-csv: im_id.", rich_help_panel=_ONE_FORMAT)
    ] = None,
    object_id: Annotated[
        int | None,
        typer.Option("--object", help="bop-csv: obj_id of the motor.", rich_help_panel=_ONE_FORMAT),
    ] = None,
    model_pose: Annotated[
        Path | None,
        typer.Option(
            "--model-pose",
            metavar="FILE",
            help="bop-csv: prior_from_motor, 4x4 mm, if BOP's model is not in the scan's frame.",
            rich_help_panel=_ONE_FORMAT,
        ),
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write tool poses with approach, contact and retreat for a robot's controller.

    A refused result, and one that leaves no bolt, gives no file and exit code 3; an older file
    of that name is removed. What each file holds: docs/robot-formats.md.
    """
    check_output(output, _suffixes(to), inputs=(poses, tcp, model_pose))
    remove_stale(output)

    from boltpose.io.hand_eye import read_hand_eye
    from boltpose.results import read_poses
    from boltpose.robot import RobotConfig, RobotFormat, plan_tools, write_robot_file
    from boltpose.saved_result import result_of

    settings = with_options(
        open_cell(config).settings("robot", RobotConfig),
        approach_mm=approach,
        retreat_mm=retreat,
        contact_offset_mm=contact_offset,
        tool_x=tool_x,
        order=order,
        include_hidden=include_hidden,
        include_unsure=include_unsure,
        include_contradicted=include_contradicted,
        min_confidence=min_confidence,
        min_tool_fits=min_tool_fits,
        max_sigma_mm=max_sigma,
        max_sigma_axis_deg=max_sigma_axis,
        fanuc_first_register=first_register,
        fanuc_count_register=count_register,
        tcp=None if tcp is None else str(tcp),
    )
    flange_from_tool: Transform | None = None
    if settings.tcp is not None:
        flange_from_tool = read_hand_eye(
            settings.tcp, unit=tcp_unit, target="flange", source="tool", option="--tcp-unit"
        ).transform
    file = read_poses(poses)
    try:
        _check_age(poses, max_age)
        if to is Target.BOP_CSV:
            _write_bop(output, file, scene, image, object_id, model_pose)
            summary: dict[str, Any] = {"written": str(output), "format": to.value}
        else:
            plan = plan_tools(result_of(file), settings, flange_from_tool)
            write_robot_file(output, plan, RobotFormat(to.value), stamp)
            summary = {"written": str(output), "format": to.value, **_summary(plan)}
            for text in plan.warnings:
                warn(text)
            if not as_json:
                _print(plan)
    except PosesRefusedError as error:
        typer.echo(f"boltpose: {error}", err=True)
        if as_json:
            refusal = {"written": None, "format": to.value, "reason": str(error)}
            typer.echo(json.dumps(refusal, indent=2))
        raise typer.Exit(ExitCode.REFUSED) from None
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
        return
    note_console().print(f"wrote {output}", soft_wrap=True, markup=False)


def with_options(config: RobotConfig, **options: Any) -> RobotConfig:
    """Return the settings with those options that were given on the command line (not None)."""
    return replace(config, **{name: value for name, value in options.items() if value is not None})


def _suffixes(to: Target) -> tuple[str, ...]:
    from boltpose.robot.files import RobotFormat

    return (".csv",) if to is Target.BOP_CSV else RobotFormat(to.value).suffixes


def _check_age(poses: Path, max_age_s: float | None) -> None:
    if max_age_s is None:
        return
    if not max_age_s > 0:
        raise ConfigError(f"--max-age must be positive, got {max_age_s}")
    age_s = time.time() - poses.stat().st_mtime
    if not 0 <= age_s <= max_age_s:
        raise PosesRefusedError(
            f"{poses} was written {age_s:.0f} s ago, --max-age allows {max_age_s:g} s: scan again"
        )


def _write_bop(
    output: Path,
    file: PosesFile,
    scene: int | None,
    image: int | None,
    object_id: int | None,
    model_pose: Path | None,
) -> None:
    from boltpose.io.atomic import write_atomic
    from boltpose.io.hand_eye import read_hand_eye
    from boltpose.robot.bop import BopTarget, bop_text, total_seconds
    from boltpose.saved_result import result_of

    if scene is None or image is None or object_id is None:
        raise ConfigError("bop-csv needs --scene, --image and --object: BOP's own numbers")
    text = bop_text(
        result_of(file),
        BopTarget(scene_id=scene, im_id=image, obj_id=object_id),
        seconds=total_seconds(list(file.timings_ms.values())),
        prior_from_model=(
            None
            if model_pose is None
            else read_hand_eye(model_pose, target="prior", source="motor").transform
        ),
    )
    content = text.encode("ascii")
    write_atomic(output, lambda stream: _put(stream, content))


def _put(stream: Any, content: bytes) -> None:
    stream.write(content)


def _summary(plan: ToolPlan) -> dict[str, Any]:
    return {
        "frame": f"base_from_{plan.moved_frame}",
        "bolts": [
            {
                "turn": pose.turn,
                "id": pose.bolt.id,
                "approach": pose.approach.matrix.tolist(),
                "contact": pose.contact.matrix.tolist(),
                "retreat": pose.retreat.matrix.tolist(),
            }
            for pose in plan.poses
        ],
        "left_out": [{"id": out.bolt.id, "reason": out.reason} for out in plan.left_out],
        "warnings": list(plan.warnings),
    }


def _print(plan: ToolPlan) -> None:
    console = answer_console()
    for pose in plan.poses:
        bolt = pose.bolt
        x, y, z = pose.contact.translation_mm
        words = " ".join(part for part in (bolt.id, bolt.name, bolt.tool) if part)
        console.print(f"{pose.turn:3d}  {words}  contact {x:.2f} {y:.2f} {z:.2f} mm", markup=False)
    for out in plan.left_out:
        console.print(f"  -  {out.bolt.id}  left out: {out.reason}", markup=False)
