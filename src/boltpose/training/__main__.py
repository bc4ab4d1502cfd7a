"""`python -m boltpose.training`: train one network, with a progress bar."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from boltpose.datasets.reman18 import Reman18
from boltpose.errors import BoltposeError
from boltpose.training.calibration import calibrate_models
from boltpose.training.cards import write_cards
from boltpose.training.runs import rescore_models, train_part_models, train_scene_model
from boltpose.training.scores import SegmentationScores

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
                console.print(_line(network, family, scores), soft_wrap=True)
            return 0
        if options.network == "cards":
            for path in write_cards(options.out, SHIPPED, data.families):
                console.print(f"written: {path}", soft_wrap=True)
            return 0
        families = data.families if options.leave_out == "each" else (options.leave_out,)
        for family in families:
            _train(console, data, options.network, family, options.out, options.cache)
    except (BoltposeError, ValueError, OSError) as error:
        console.print(f"boltpose: {error}", style="red")
        return 2
    return 0


def _train(
    console: Console, data: Reman18, network: str, family: str, out: Path, cache: Path
) -> None:
    """Train one network and print its scores."""
    left_out = None if family == "none" else family
    folder = SHIPPED if left_out is None else out / family
    train = train_part_models if network == "parts" else train_scene_model
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

        scores = train(data, left_out, cache, folder, on_progress=on_progress)
    if scores is None:
        console.print(f"{network}: trained on all families, written to {folder}")
        return
    console.print(_line(network, family, scores), soft_wrap=True)


def _line(network: str, family: str, scores: SegmentationScores) -> str:
    """Scores in one line."""
    listed = ", ".join(f"{name} {value:.3f}" for name, value in scores.iou.items())
    return (
        f"{network} without {family}: OA {scores.overall_accuracy:.4f}, "
        f"mIoU {scores.mean_iou:.4f} ({listed})"
    )


if __name__ == "__main__":
    sys.exit(main())
