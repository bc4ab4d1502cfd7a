"""`boltpose demo`: the whole way on a motor that comes with the package."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from boltpose.cli.console import answer_json, note_console
from boltpose.cli.outputs import check_folder

DEMO_FOLDER = Path(__file__).resolve().parent.parent / "demo"
"""A simulated motor of reman18: full scan, one view with its camera file, hand-eye matrix."""


def run_demo(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")
    ] = Path("demo_output"),
) -> None:
    """Build the shipped motor's prior, then locate its bolts in the shipped scan."""
    check_folder(output, "the results")
    output.mkdir(parents=True, exist_ok=True)

    from boltpose.cli.prior_build import build

    notes = note_console()
    prior = output / "motor.prior.npz"
    scan = DEMO_FOLDER / "full_scan.ply"
    notes.print(
        f"\n[bold]1. boltpose prior build {scan.name}[/]   (simulated data, once per motor)"
    )
    build(scan, prior, picture=output / "prior.png", name="demo motor")
    notes.print("\n[bold]2. boltpose locate[/]   (once per clamped motor)")
    try:
        _locate(prior, output)
    finally:  # also of a refusal
        poses = output / "poses.json"
        if poses.exists():
            answer_json({"poses": str(poses), "report": str(output / "report.html")})


def _locate(prior: Path, output: Path) -> None:
    from boltpose.cli.locate import locate_bolts

    locate_bolts(
        [DEMO_FOLDER / "000002.png"],
        prior,
        hand_eye=[DEMO_FOLDER / "hand_eye.yaml"],
        camera=DEMO_FOLDER / "scene_camera.json",
        output=output / "poses.json",
        picture=output / "demo.png",
        report=output / "report.html",
        config=Path(os.devnull),  # the demo's own files, whatever cell it is tried in
    )
