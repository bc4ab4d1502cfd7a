"""The data card: what a data set holds and what it is not, made from what is on disk."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np

from boltpose.io.atomic import write_atomic
from boltpose.synthesis.card_texts import ANGLES_TEXT, FORMAT_TEXT, LIMITS_TEXT, SCENES_FORMAT_TEXT
from boltpose.synthesis.compare import compare_table, count_table
from boltpose.synthesis.folder import read_settings, read_version
from boltpose.synthesis.preview import FOLDER, MOTORS_NAME, VIEWS_NAME
from boltpose.synthesis.settings import DataSetSettings, Kind
from boltpose.synthesis.statistics import (
    CLASS_NAMES,
    DataSetStatistics,
    quantiles,
    read_statistics,
)

CARD_NAME = "README.md"
_FRACTION_EDGES = (0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0)
_MAX_LISTED = 60
"""Motors in the last table."""


def write_card(root: Path) -> Path:
    """Write `README.md` into a data set's folder.

    Raises:
        InputFileError: It is no data set of `boltpose synth`, or a file is missing or damaged.
    """
    text = render_card(read_statistics(root), read_settings(root), read_version(root))
    path = root / CARD_NAME

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomic(path, write)
    return path


def render_card(data: DataSetStatistics, settings: DataSetSettings, version: str) -> str:
    """Lay out the card as Markdown.

    Args:
        data: What was counted.
        settings: What the data set was made with.
        version: Of this package, when the data set was begun.
    """
    motors, views = len(data.motors), len(data.views)
    what = f"{motors} synthetic starter motors"
    if views:
        what += f" in {views // settings.angles} clampings"
    if settings.angles > 1:
        what += f", {settings.angles} views each"
    sections = [
        f"# {what}",
        "**This data set is simulated**: no real motor, scanner or camera was involved. "
        f"Made by `boltpose` {version} with\n\n    {_command(settings, motors)}\n\n"
        "which makes the same bytes again, with any number of workers.",
        *_pictures(data.root),
        FORMAT_TEXT,
        *([SCENES_FORMAT_TEXT] if settings.kind is Kind.SCENES else []),
        *([ANGLES_TEXT.format(angles=settings.angles)] if settings.angles > 1 else []),
        "## In numbers",
        "Ranges are minimum / median / maximum.",
        compare_table([data], ["this data set"]),
        *_scans(data),
        *(_views(data) if views else []),
        *_motors(data),
        LIMITS_TEXT,
    ]
    return "\n\n".join(section.strip("\n") for section in sections) + "\n"


def _command(settings: DataSetSettings, count: int) -> str:
    words = [f"boltpose synth {settings.kind} -n {count} --seed {settings.seed}"]
    words.append(f"--families {','.join(settings.families)}")
    if settings.kind is Kind.SCENES:
        words.append(f"--views {settings.views} --size {settings.width_px}x{settings.height_px}")
        words.append(f"--clamps {','.join(settings.clamps)}")
        words += [] if settings.angles == 1 else [f"--angles {settings.angles}"]
        words += [] if settings.with_changes else ["--no-changes"]
    words += [] if settings.with_wear else ["--no-wear"]
    return " ".join([*words, "-o DIR"])


def _pictures(root: Path) -> list[str]:
    captions = {
        MOTORS_NAME: "Motors: the model by material, its full scan by class",
        VIEWS_NAME: "Views: the depth image lit from the camera, and by class",
    }
    return [
        f"![{text}]({FOLDER}/{name})\n\n*{text}.*"
        for name, text in captions.items()
        if (root / FOLDER / name).exists()
    ]


def _scans(data: DataSetStatistics) -> list[str]:
    total = data.class_points.sum()
    points = "\n".join(
        f"| {name} | {int(count)} | {100 * count / total:.1f} % |"
        for name, count in zip(CLASS_NAMES, data.class_points, strict=True)
    )
    return [
        "### Full scans",
        f"| class | points | share |\n|---|---|---|\n{points}",
        count_table("family", [motor.family for motor in data.motors]),
        count_table("bolts of a motor", [f"{len(motor.bolts)}" for motor in data.motors]),
        _heads(data),
    ]


def _heads(data: DataSetStatistics) -> str:
    """Bolts by head and thread."""
    threads = sorted({bolt.thread_mm for bolt in data.bolts})
    heads = sorted({bolt.head for bolt in data.bolts})
    counts = {
        (head, thread): sum(bolt.head == head and bolt.thread_mm == thread for bolt in data.bolts)
        for head in heads
        for thread in threads
    }
    rows = [
        f"| {head} | {' | '.join(str(counts[head, thread]) for thread in threads)} |"
        for head in heads
    ]
    lines = [
        f"| head | {' | '.join(f'M{thread}' for thread in threads)} |",
        f"|---|{'---|' * len(threads)}",
    ]
    return "\n".join([*lines, *rows])


def _views(data: DataSetStatistics) -> list[str]:
    hidden = [100 * view.hidden_share for view in data.views]
    low, middle, high = quantiles(hidden, 0.1, 0.5, 0.9)
    between = 100 * float(np.mean([30 <= share <= 70 for share in hidden]))
    fractions = [fraction for view in data.views for fraction in view.visible_fractions]
    gone = sum(view.gone for view in data.views)
    return [
        "### Views",
        count_table("clamp", [view.clamp for view in data.views]),
        f"Share of a view's bolts that are not visible: median {middle:.0f} %, 10-90 % range "
        f"{low:.0f}-{high:.0f} %; between 30 and 70 % in {between:.0f} % of the views. "
        f"{gone} bolts were gone between scan and clamping (not counted as hidden).",
        "Visible fraction of bolt heads, one count per bolt and view:",
        _histogram(fractions),
    ]


def _histogram(fractions: Sequence[float]) -> str:
    values = np.asarray(fractions, dtype=np.float64)
    counts, _ = np.histogram(values[values > 0], _FRACTION_EDGES)
    bins = pairwise(_FRACTION_EDGES)
    titles = ["0", *(f"{low:g}-{high:g}" for low, high in bins)]
    cells = [int((values == 0).sum()), *counts.tolist()]
    return (
        f"| fraction | {' | '.join(titles)} |\n|---|{'---|' * len(titles)}\n"
        f"| bolts | {' | '.join(map(str, cells))} |"
    )


def _motors(data: DataSetStatistics) -> list[str]:
    retried = sum(m.retries for m in data.motors) + sum(view.retries for view in data.views)
    rows = [
        f"| {motor.name} | {motor.family} | {motor.scan_points} | {len(motor.bolts)} | "
        f"{' '.join(f'{100 * view.hidden_share:.0f}%' for view in motor.views) or '-'} |"
        for motor in data.motors[:_MAX_LISTED]
    ]
    left_out = len(data.motors) - len(rows)
    more = [f"and {left_out} more."] if left_out else []
    return [
        "### Motors",
        f"{retried} draws could not be built and were drawn again from a seed derived from "
        "theirs; the files name the reasons (`retries`).",
        "\n".join(
            [
                "| motor | family | scan points | bolts | not visible per view |",
                "|---|---|---|---|---|",
                *rows,
            ]
        ),
        *more,
    ]
