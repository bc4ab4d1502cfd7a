"""`boltpose train parts|scene`: the networks, from labelled scans to ONNX."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from boltpose.errors import ConfigError, MissingExtraError

DataOption = Annotated[
    Path, typer.Option("--data", metavar="DIR", help="The data set, a folder like reman18.")
]
LeaveOutOption = Annotated[
    str,
    typer.Option(
        "--leave-out",
        metavar="FAMILY",
        help="Family the network must not see; `each` for one after the other, `none` for the "
        "networks that are shipped.",
    ),
]
OutOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder of the leave-one-out networks.")
]
CacheOption = Annotated[
    Path, typer.Option("--cache", metavar="DIR", help="Features and checkpoints; runs resume.")
]
TestOption = Annotated[
    Path | None,
    typer.Option(
        "--test",
        metavar="DIR",
        help="Train on all of --data and score on this data set; the networks go to a folder "
        "zero_shot in --out.",
    ),
]
RecipeOption = Annotated[
    str,
    typer.Option(
        "--recipe", metavar="few|many", help="`many` is for hundreds of synthetic motors."
    ),
]
WorkersOption = Annotated[
    int, typer.Option("--workers", min=1, metavar="N", help="Processes that compute features.")
]

_DATA = Path("data/reman18")
_OUT = Path("data/models/leave_family_out")
_CACHE = Path("runs/training")


def train_parts(
    data: DataOption = _DATA,
    leave_out: LeaveOutOption = "none",
    out: OutOption = _OUT,
    cache: CacheOption = _CACHE,
    test: TestOption = None,
    recipe: RecipeOption = "few",
    workers: WorkersOption = 1,
) -> None:
    """Train the networks that tell the parts of a full scan."""
    _train("parts", data, leave_out, out, cache, _more(test, recipe, workers))


def train_scene(
    data: DataOption = _DATA,
    leave_out: LeaveOutOption = "none",
    out: OutOption = _OUT,
    cache: CacheOption = _CACHE,
    test: TestOption = None,
    recipe: RecipeOption = "few",
    workers: WorkersOption = 1,
) -> None:
    """Train the network that tells the motor from its surroundings in a view."""
    _train("scene", data, leave_out, out, cache, _more(test, recipe, workers))


def _more(test: Path | None, recipe: str, workers: int) -> list[str]:
    """Options that both networks share, as `python -m boltpose.training` takes them."""
    if recipe not in ("few", "many"):
        raise ConfigError(f"--recipe must be few or many, got {recipe}")
    options = ["--recipe", recipe, "--workers", str(workers)]
    return options if test is None else [*options, "--test", str(test)]


def _train(
    network: str, data: Path, leave_out: str, out: Path, cache: Path, more: list[str]
) -> None:
    try:
        from boltpose.training.__main__ import main as run_training
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.split(".")[0] == "boltpose":
            raise
        raise MissingExtraError(str(error.name), "train") from error
    places = {"--data": data, "--out": out, "--cache": cache}
    options = [str(part) for pair in places.items() for part in pair]
    code = run_training([network, "--leave-out", leave_out, *options, *more])
    if code:
        raise typer.Exit(code)
