"""`python -m boltpose.training`: train one network, with a progress bar."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from boltpose.datasets.reman18 import Reman18
from boltpose.errors import BoltposeError, ConfigError
from boltpose.training.calibration import calibrate_models
from boltpose.training.cards import write_cards
from boltpose.training.parts import PartsConfig
from boltpose.training.runs import rescore_models, train_part_models, train_scene_model
from boltpose.training.scene import SceneConfig
from boltpose.training.scores import SegmentationScores

ZERO_SHOT = "zero_shot"
"""Folder under --out of networks that are scored on another data set."""
SHIPPED = Path(__file__).parents[1] / "segmentation" / "weights"


def main(arguments: list[str] | None = None) -> int:
    """Parse, train, and turn our own errors into one line on stderr and exit code 2."""
    parser = argparse.ArgumentParser(prog="python -m boltpose.training", description=__doc__)
    parser.add_argument("network", choices=("parts", "scene", "calibrate", "scores", "cards"))
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument(
        "--leave-out",
        default="none",
        help="family the networks must not see, 'none' or 'each' (one after the other)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("data/models/leave_family_out"),
        help="folder of the leave-one-out networks; without a family left out, the shipped ones",
    )
    parser.add_argument("--cache", type=Path, default=Path("runs/training"))
    parser.add_argument(
        "--test",
        type=Path,
        help="train on all of --data, score on this data set; networks go to --out/zero_shot",
    )
    parser.add_argument(
        "--recipe", choices=("few", "many"), default="few", help="many: for hundreds of motors"
    )
    parser.add_argument("--workers", type=int, default=1, help="processes that compute features")
    options = parser.parse_args(arguments)
    console = Console(stderr=True)
    try:
        data = Reman18(root=options.data)
        if options.network == "calibrate":
            for line in calibrate_models(data, options.out, SHIPPED):
                console.print(line, soft_wrap=True)
            return 0
        if options.network == "scores":
            for network, family, scores in rescore_models(data, options.out):
                console.print(_line(network, f"without {family}", scores), soft_wrap=True)
            return 0
        if options.network == "cards":
            for path in write_cards(options.out, SHIPPED, data.families):
                console.print(f"written: {path}", soft_wrap=True)
            return 0
        job = _Job(
            network=options.network,
            out=options.out,
            cache=options.cache,
            recipe=options.recipe,
            workers=options.workers,
        )
        if options.test is not None:
            if options.leave_out != "none":
                raise ConfigError(f"--test and --leave-out {options.leave_out} exclude each other")
            _train(console, data, "none", job, test=Reman18(root=options.test))
            return 0
        families = data.families if options.leave_out == "each" else (options.leave_out,)
        for family in families:
            _train(console, data, family, job)
    except (BoltposeError, ValueError, OSError) as error:
        console.print(f"boltpose: {error}", style="red")
        return 2
    return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    """What all runs of one call share."""

    network: str
    out: Path
    cache: Path
    recipe: str
    workers: int


def _train(
    console: Console, data: Reman18, family: str, job: _Job, *, test: Reman18 | None = None
) -> None:
    """Train one network and print its scores."""
    left_out = None if family == "none" else family
    if test is not None:
        folder = job.out / ZERO_SHOT
    else:
        folder = SHIPPED if left_out is None else job.out / family
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}  loss {task.fields[loss]:.4f}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        tasks: dict[str, TaskID] = {}

        def on_progress(what: str, step: int, steps: int, loss: float) -> None:
            if what not in tasks:
                tasks[what] = progress.add_task(what, total=steps, loss=loss)
            progress.update(tasks[what], completed=step + 1, loss=loss)

        many = job.recipe == "many"
        if job.network == "parts":
            scores = train_part_models(
                data,
                left_out,
                job.cache,
                folder,
                PartsConfig.for_many_motors() if many else PartsConfig(),
                test=test,
                workers=job.workers,
                on_progress=on_progress,
            )
        else:
            scores = train_scene_model(
                data,
                left_out,
                job.cache,
                folder,
                SceneConfig.for_many_motors() if many else SceneConfig(),
                test=test,
                workers=job.workers,
                on_progress=on_progress,
            )
    if scores is None:
        console.print(f"{job.network}: trained on all families, written to {folder}")
        return
    what = f"without {family}" if test is None else f"on {test.root}, trained on {data.root}"
    console.print(_line(job.network, what, scores), soft_wrap=True)


def _line(network: str, what: str, scores: SegmentationScores) -> str:
    """Scores in one line."""
    listed = ", ".join(f"{name} {value:.3f}" for name, value in scores.iou.items())
    return (
        f"{network} {what}: OA {scores.overall_accuracy:.4f}, mIoU {scores.mean_iou:.4f} ({listed})"
    )


if __name__ == "__main__":
    sys.exit(main())
