"""`boltpose view`: a result, a prior, or scans as they come, in the browser."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from boltpose.cli.console import note_console
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
        LengthUnit, typer.Option("--scan-unit", help="With --live: unit of the scans.")
    ] = LengthUnit.MM,
    hand_eye_unit: Annotated[
        LengthUnit, typer.Option("--hand-eye-unit", help="Unit of the hand-eye matrix.")
    ] = LengthUnit.MM,
    models: ModelsOption = None,
    port: Annotated[
        int, typer.Option("--port", help="Port on this machine; 0 is any free one.")
    ] = 8321,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Only print the address.")
    ] = False,
) -> None:
    """Show a result in the browser, or locate scans there; Ctrl-C ends it.

    Examples:
      boltpose view poses.json

      boltpose view motor.prior.npz

      boltpose view --live --prior motor.prior.npz --hand-eye hand_eye.yaml --watch scans/
    """
    _check_options(file, live=live, prior=prior, hand_eye=hand_eye, watch=watch, camera=camera)

    from boltpose.viewer.config import ViewerConfig
    from boltpose.viewer.live import LivePage, SavedPage
    from boltpose.viewer.page import Page
    from boltpose.viewer.prior_page import show_prior
    from boltpose.viewer.result_page import ResultPage

    title = "boltpose live" if file is None else f"boltpose: {file.name}"
    with Page(title, ViewerConfig(port=port)) as page:
        if file is None:
            assert prior is not None
            locate = _locator(
                prior,
                hand_eye,
                camera,
                scan_unit=scan_unit,
                hand_eye_unit=hand_eye_unit,
                models=models,
            )
            LivePage(ResultPage(page), locate, watch)
        elif file.suffix.lower() == PRIOR_SUFFIX:
            show_prior(page, file)
        else:
            SavedPage(ResultPage(page), file, lambda path: _open_saved(path, scan, prior))
        notes = note_console()
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
    prior: Path | None,
    hand_eye: Path | None,
    watch: Path | None,
    camera: Path | None,
) -> None:
    if live == (file is not None):
        raise ConfigError("give a poses.json or a .prior.npz to look at, or --live: one of them")
    if live and prior is None:
        raise ConfigError("--live needs --prior, the motor's .prior.npz or a folder of them")
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


def _locator(
    prior: Path,
    hand_eye: Path | None,
    camera: Path | None,
    *,
    scan_unit: LengthUnit,
    hand_eye_unit: LengthUnit,
    models: Path | None,
) -> Callable[[Path], Shown]:
    """Make the function that does with a scan what `boltpose locate` does.

    Prior and hand-eye are read for every scan again: what was corrected meanwhile counts. All are
    read once at the start too, so that a bad file is told on the command line.
    """
    from boltpose.cli.load import read_hand_eye_of
    from boltpose.cli.locate_call import call_locate
    from boltpose.cli.locate_inputs import hash_inputs, read_shots
    from boltpose.locate_config import LocateConfig
    from boltpose.prior.file import read_prior
    from boltpose.prior.folder import open_prior_folder
    from boltpose.segmentation.models import load_models
    from boltpose.viewer.result_page import Shown

    networks = load_models(models)
    read_hand_eye_of(hand_eye, None, hand_eye_unit)
    if prior.is_dir():
        open_prior_folder(prior)
    else:
        read_prior(prior)
    hand_eyes = [] if hand_eye is None else [hand_eye]

    def locate(path: Path) -> Shown:
        seconds: dict[str, float] = {}
        scan_camera = camera if path.suffix.lower() == ".png" else None
        shots = read_shots(
            [path],
            hand_eyes,
            [],
            scan_unit=scan_unit,
            hand_eye_unit=hand_eye_unit,
            camera=scan_camera,
            sigma=None,
        )
        provenance = {
            **hash_inputs([path], prior, hand_eyes, [], scan_unit=scan_unit, camera=scan_camera),
            "models": dict(networks.hashes),
        }
        call = call_locate(
            shots, prior, networks.scene, LocateConfig(), provenance, seconds.__setitem__
        )
        return Shown(
            result=call.result,
            scan=call.scan,
            prior=call.prior,
            timings_ms={stage: 1000 * time for stage, time in seconds.items()},
        )

    return locate
