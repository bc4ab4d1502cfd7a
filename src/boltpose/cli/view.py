"""`boltpose view`: a result, a prior, or scans as they come, in the browser."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from boltpose.cli.cell import ConfigOption, open_cell
from boltpose.cli.console import answer_json, note_console
from boltpose.cli.locate_settings import LocateSettings, settle
from boltpose.cli.options import LengthUnit, ModelsOption
from boltpose.errors import ConfigError

if TYPE_CHECKING:
    from boltpose.viewer.result_page import Shown

PRIOR_SUFFIX = ".npz"


def view(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[FILE]", help="A poses.json, or a .prior.npz."),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Locate every scan that is dropped into the page.")
    ] = False,
    scan: Annotated[
        Path | None,
        typer.Option("--scan", metavar="FILE", help="Where the scan of a poses.json is by now."),
    ] = None,
    prior: Annotated[
        Path | None,
        typer.Option(
            "--prior",
            metavar="FILE|DIR",
            help="Where the prior is by now; with --live the motor's prior, or a folder of them.",
        ),
    ] = None,
    hand_eye: Annotated[
        Path | None,
        typer.Option(
            "--hand-eye",
            metavar="FILE",
            help="With --live: base_from_camera of a camera that stands still.",
        ),
    ] = None,
    watch: Annotated[
        Path | None,
        typer.Option(
            "--watch", metavar="DIR", help="With --live: locate each scan written to this folder."
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option("--camera", metavar="JSON", help="With --live: scene_camera.json of .png."),
    ] = None,
    scan_unit: Annotated[
        LengthUnit | None, typer.Option("--scan-unit", help="With --live: unit of the scans; mm.")
    ] = None,
    hand_eye_unit: Annotated[
        LengthUnit | None, typer.Option("--hand-eye-unit", help="Unit of the hand-eye matrix; mm.")
    ] = None,
    models: ModelsOption = None,
    port: Annotated[
        int | None, typer.Option("--port", help="Port on this machine; 8321, 0 is any free one.")
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Only print the address.")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Show a result in the browser, or locate scans there; Ctrl-C ends it."""
    _check_options(file, live=live, hand_eye=hand_eye, watch=watch, camera=camera)
    cell = open_cell(config)

    from boltpose.viewer.config import ViewerConfig
    from boltpose.viewer.live import LivePage, SavedPage
    from boltpose.viewer.page import Page
    from boltpose.viewer.prior_page import show_prior
    from boltpose.viewer.result_page import ResultPage

    title = "boltpose live" if file is None else f"boltpose: {file.name}"
    settings = cell.settings("viewer", ViewerConfig)
    if port is not None:
        settings = replace(settings, port=port)
    given = None
    if file is None:
        given = settle(
            cell.locate(),
            scans=[Path("live.png")],  # depth images may come, too
            prior=prior,
            hand_eyes=[] if hand_eye is None else [hand_eye],
            robot_poses=[],
            scan_unit=scan_unit,
            hand_eye_unit=hand_eye_unit,
            hand_eye_sigma=None,
            tool_tolerance=None,
            camera=camera,
            method=None,
            models=models,
        )
    with Page(title, settings) as page:
        if given is not None:
            LivePage(ResultPage(page), _locator(given, cell.provenance()), watch)
        elif file is not None and file.suffix.lower() == PRIOR_SUFFIX:
            show_prior(page, file)
        elif file is not None:
            SavedPage(ResultPage(page), file, lambda path: _open_saved(path, scan, prior))
        notes = note_console()
        answer_json({"url": page.url})  # while the page is there, not after
        notes.print(f"open [bold]{page.url}[/] in the browser; Ctrl-C ends it", soft_wrap=True)
        if not no_browser:
            webbrowser.open(page.url)
        try:
            page.wait()
        except KeyboardInterrupt:
            notes.print("closed")


def _check_options(
    file: Path | None,
    *,
    live: bool,
    hand_eye: Path | None,
    watch: Path | None,
    camera: Path | None,
) -> None:
    if live == (file is not None):
        raise ConfigError("give a poses.json or a .prior.npz to look at, or --live: one of them")
    if not live:
        for option, value in (("--hand-eye", hand_eye), ("--watch", watch), ("--camera", camera)):
            if value is not None:
                raise ConfigError(f"{option} goes with --live only")


def _open_saved(path: Path, scan: Path | None, prior: Path | None) -> Shown:
    from boltpose.saved_result import open_saved_result
    from boltpose.viewer.result_page import Shown

    saved = open_saved_result(path, scan, prior)
    return Shown(
        result=saved.result, scan=saved.scan, prior=saved.prior, timings_ms=saved.timings_ms
    )


def _locator(given: LocateSettings, provenance: Mapping[str, Any]) -> Callable[[Path], Shown]:
    """Make the function that does with a scan what `boltpose locate` does.

    Prior and hand-eye are read for every scan again: what was corrected meanwhile counts. All are
    read once at the start too, so that a bad file is told on the command line.
    """
    from boltpose.cli.locate_call import call_locate
    from boltpose.cli.locate_inputs import hash_inputs, read_shots
    from boltpose.io.camera_pose import read_camera_pose
    from boltpose.locate_config import LocateConfig
    from boltpose.prior.file import read_prior
    from boltpose.prior.folder import open_prior_folder
    from boltpose.registration.config import RegistrationConfig
    from boltpose.segmentation.models import load_models
    from boltpose.viewer.result_page import Shown

    networks = load_models(given.models)
    for hand_eye in given.hand_eyes:
        read_camera_pose(hand_eye, None, given.hand_eye_unit)
    if given.prior.is_dir():
        open_prior_folder(given.prior)
    else:
        read_prior(given.prior)
    config = LocateConfig(
        registration=RegistrationConfig(method=given.registration_method), tool=given.tool
    )

    def locate(path: Path) -> Shown:
        seconds: dict[str, float] = {}
        camera = given.camera if path.suffix.lower() == ".png" else None
        shots = read_shots(
            [path],
            given.hand_eyes,
            [],
            scan_unit=given.scan_unit,
            hand_eye_unit=given.hand_eye_unit,
            camera=camera,
            sigma=given.hand_eye_sigma,
        )
        about = {
            **hash_inputs(
                [path], given.prior, given.hand_eyes, [], scan_unit=given.scan_unit, camera=camera
            ),
            "models": dict(networks.hashes),
            **provenance,
        }
        call = call_locate(shots, given.prior, networks.scene, config, about, seconds.__setitem__)
        return Shown(
            result=call.result,
            scan=call.scan,
            prior=call.prior,
            timings_ms={stage: 1000 * time for stage, time in seconds.items()},
        )

    return locate
