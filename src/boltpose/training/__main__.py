"""`python -m boltpose.training`: from finished trainings to the networks that are shipped."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from boltpose.datasets.reman18 import Reman18
from boltpose.errors import BoltposeError
from boltpose.training.calibration import calibrate_models
from boltpose.training.cards import write_cards
from boltpose.training.runs import rescore_models
from boltpose.training.shipping import ship_models

SHIPPED = Path(__file__).parents[1] / "segmentation" / "weights"


def main(arguments: list[str] | None = None) -> int:
    """Parse, work, and turn our own errors into one line on stderr and exit code 2."""
    parser = argparse.ArgumentParser(prog="python -m boltpose.training", description=__doc__)
    parser.add_argument(
        "what",
        choices=("ship", "calibrate", "scores", "cards"),
        help="ship: copy networks from run folders; calibrate: set their temperatures; "
        "scores: score them again; cards: write their model cards",
    )
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("data/models/leave_family_out"),
        help="folder of the networks with a family left out",
    )
    parser.add_argument("--shipped", type=Path, default=SHIPPED, help="folder of the others")
    parser.add_argument("--parts", type=Path, default=Path("runs/models/parts"), help="ship: runs")
    parser.add_argument("--scene", type=Path, default=Path("runs/models/scene"), help="ship: runs")
    parser.add_argument(
        "--report",
        type=Path,
        default=Path("results/calibration.json"),
        help="calibrate: how well the probabilities hold is written here",
    )
    options = parser.parse_args(arguments)
    console = Console(stderr=True)
    try:
        for line in _work(options, Reman18(root=options.data)):
            console.print(line, soft_wrap=True)
    except (BoltposeError, ValueError, OSError) as error:
        console.print(f"boltpose: {error}", style="red", soft_wrap=True)
        return 2
    return 0


def _work(options: argparse.Namespace, data: Reman18) -> Iterator[str]:
    """Do it; a line for everything done."""
    match options.what:
        case "ship":
            runs = {"parts": options.parts, "scene": options.scene}
            for place in ship_models(runs, options.out, options.shipped, data.families):
                yield f"filled: {place}"
        case "calibrate":
            yield from calibrate_models(data, options.out, options.shipped, options.report)
        case "scores":
            for network, family, scores in rescore_models(data, options.out):
                yield (
                    f"{network} without {family}: OA {scores.overall_accuracy:.4f}, "
                    f"mIoU {scores.mean_iou:.4f}"
                )
        case _:
            for path in write_cards(options.out, options.shipped, data.families):
                yield f"written: {path}"


if __name__ == "__main__":
    sys.exit(main())
