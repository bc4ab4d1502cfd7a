"""The labels of a scan as a person reads them in a terminal."""

from __future__ import annotations

from rich import box
from rich.table import Table
from rich.text import Text

from boltpose.arrays import Float32Array, UInt8Array
from boltpose.io.palette import PALETTE
from boltpose.schema import Part

DOUBTFUL = 0.7
"""Points below this confidence are counted, so that a person knows how much there is to check."""


def describe_labels(
    labels: UInt8Array, confidence: Float32Array | None, *, is_scene: bool = False
) -> Table:
    """Lay out how many points have which label.

    Args:
        labels: Shape (N,), `Part` numbers.
        confidence: Shape (N,), probability of the label, where a network gave it.
        is_scene: Label 1 stands for the whole motor.
    """
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("label", justify="right")
    table.add_column("class")
    table.add_column("RGB")
    table.add_column("points", justify="right")
    table.add_column("share", justify="right")
    if confidence is not None:
        table.add_column(f"below {DOUBTFUL:g}", justify="right")
    for part in Part:
        is_part = labels == part
        count = int(is_part.sum())
        if count == 0:
            continue
        is_motor = is_scene and part is not Part.BACKGROUND
        name = "motor" if is_motor else part.name.lower().replace("_", " ")
        red, green, blue = PALETTE[part]
        swatch = Text.assemble(("■ ", f"rgb({red},{green},{blue})"), f"{red} {green} {blue}")
        cells = [str(part.value), name, swatch, str(count), f"{count / len(labels):.1%}"]
        if confidence is not None:
            cells.append(str(int((confidence[is_part] < DOUBTFUL).sum())))
        table.add_row(*cells)
    return table
