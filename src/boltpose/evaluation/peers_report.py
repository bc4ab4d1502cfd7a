"""Registration methods of others beside ours: the section of `docs/results.md`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from boltpose.evaluation.peers_methods import METHODS, OURS, PEERS
from boltpose.evaluation.peers_records import (
    FOLDER,
    Failure,
    Mask,
    PeerCase,
    PeerFile,
    read_peer_files,
)
from boltpose.evaluation.statistics import spread_of
from boltpose.evaluation.tables import markdown_table
from boltpose.schema import Status

_EVERY_VIEW = 72
_HEADINGS = {
    Mask.NETWORK: "Masks by a scene network that has not seen the motor's family",
    Mask.CLAMP20: "A fifth of the mask is clamp: one patch of it beside the true motor points",
}
_HOW = """\
`make bench-registration`, on the views of reman18 (simulated). Every method gets the same points
and the same prior (built from the full scan by networks that have not seen its family), and may
prepare the prior beforehand. The coarse methods of others are refined by the paper's three
point-to-plane steps (10, 1, 0.1 mm, Open3D), the two of small_gicp start at the best pose of *our*
coarse stage and take steps of 3 and 1 mm. *right*: every bolt within 2 mm and 2 degrees; *roll*:
turned about the housing's axis; *slide*: moved along it; *flip*: end over end. Time is registration
alone, all threads, on shared cores: CPU seconds compare methods, wall seconds hardly. Ours includes
refining again on the points near the pose, and chooses among several candidates. What a method
learns of a prior once is not counted: for PPF that is half a minute or more, for others at most
seconds. `decrease_mu`: the best of eight settings of voxel and distance, tried on three views.

No method but ours has a verdict: *doubted by itself* counts wrong poses that it calls invalid or
not converged. The last columns ask our `verify` about everybody's poses, also with their masks."""


def sections(results: Path) -> list[str]:
    """Render what `results/peers` holds, Markdown; nothing if it holds nothing."""
    parts: list[str] = []
    for mask, heading in _HEADINGS.items():
        files = read_peer_files(results / FOLDER, METHODS, mask)
        if files:
            parts += [f"### {heading}", peer_table(files), verdict_table(files)]
            parts += [text for text in (_winners(files), _fit_sentence(files)) if text]
    return ["## Registration methods of others", _HOW, *parts] if parts else []


def peer_table(files: Sequence[PeerFile]) -> str:
    """How often every method is right, how it fails, how accurate and how fast it is."""
    modes = [mode for mode in Failure if mode is not Failure.RIGHT]
    rows: list[list[str]] = []
    for file in files:
        views = len(file.cases)
        counts = [sum(case.failure is mode for case in file.cases) for mode in modes]
        rows.append(
            [
                _title(file.method) + ("" if views == _EVERY_VIEW else f" ({views} views only)"),
                f"{len(_right(file.cases))} / {views}",
                *(str(count) if count else "" for count in counts),
                _spread(_errors(file)),
                f"{np.median([case.cpu_s for case in file.cases]):.2f}",
                f"{np.median([case.wall_s for case in file.cases]):.2f}",
            ]
        )
    worst = "worst bolt of the right, mm (median / 95 % / max)"
    return markdown_table(
        ["method", "right", *(str(mode) for mode in modes), worst, "CPU s", "wall s"], rows
    )


def verdict_table(files: Sequence[PeerFile]) -> str:
    """Who notices wrong poses."""
    rows: list[list[str]] = []
    for file in files:
        posed = [case for case in file.cases if case.pose]
        wrong = [case for case in posed if case.failure is not Failure.RIGHT]
        right = _right(posed)
        rows.append(
            [
                _title(file.method),
                str(len(wrong)),
                str(sum(not case.is_claimed for case in wrong)),
                f"{sum(not _is_accepted(case) for case in wrong)}",
                f"{sum(_is_accepted(case) for case in wrong)}",
                f"{sum(not _is_accepted(case) for case in right)} / {len(right)}",
            ]
        )
    return markdown_table(
        [
            "method",
            "wrong poses",
            "doubted by itself",
            "refused by `verify`",
            "accepted, wrong",
            "right, yet refused",
        ],
        rows,
    )


def _winners(files: Sequence[PeerFile]) -> str:
    """Say in what another method is better than ours, on the same views."""
    ours = next((file for file in files if file.method == OURS), None)
    if ours is None:
        return ""
    said: list[str] = []
    for file in files:
        if file is ours or _views(file) != _views(ours):
            continue
        better: list[str] = []
        if len(_right(file.cases)) > len(_right(ours.cases)):
            better.append(
                f"right more often ({len(_right(file.cases))} against {len(_right(ours.cases))})"
            )
        both = _right_views(file) & _right_views(ours)
        if both:
            for name, number in (("median", np.median), ("largest", np.max)):
                mine, theirs = (float(number(_errors(f, both))) for f in (ours, file))
                if round(theirs, 3) < round(mine, 3):
                    better.append(f"a smaller {name} error ({theirs:.3f} against {mine:.3f} mm)")
        mine, theirs = (float(np.median([c.cpu_s for c in f.cases])) for f in (ours, file))
        if round(theirs, 2) < round(mine, 2):
            better.append(f"faster ({theirs:.2f} against {mine:.2f} CPU s)")
        if better:
            said.append(f"- {_title(file.method)}: {', '.join(better)}.")
    if not said:
        return "No method beats ours in success, in median or largest error, or in time."
    return "\n".join(
        [
            "Where others are better than ours (errors: of the views where both are right):",
            "",
            *said,
        ]
    )


def _fit_sentence(files: Sequence[PeerFile]) -> str:
    cases = [case for file in files if file.method != OURS for case in file.cases]
    right = [case.fit_mm for case in _right(cases) if case.fit_mm is not None]
    wrong = [
        case.fit_mm
        for case in cases
        if case.failure is not Failure.RIGHT and case.fit_mm is not None
    ]
    if not right or not wrong:
        return ""
    return (
        "The RMSE of the pairs nearer than 0.1 mm, the paper's measure, tells nothing apart: "
        f"{np.median(right):.4f} mm (median) for the right poses of others, "
        f"{np.median(wrong):.4f} mm for their wrong ones."
    )


def _title(method: str) -> str:
    return next((peer.title for peer in PEERS if peer.name == method), "**ours**")


def _views(file: PeerFile) -> set[tuple[str, int]]:
    return {(case.motor, case.view) for case in file.cases}


def _right(cases: Iterable[PeerCase]) -> list[PeerCase]:
    return [case for case in cases if case.failure is Failure.RIGHT]


def _right_views(file: PeerFile) -> set[tuple[str, int]]:
    return {(case.motor, case.view) for case in _right(file.cases)}


def _errors(file: PeerFile, views: set[tuple[str, int]] | None = None) -> list[float]:
    """Worst bolts of the right poses, mm, of some views or of all."""
    return [
        case.error.worst_bolt_mm
        for case in _right(file.cases)
        if case.error is not None and (views is None or (case.motor, case.view) in views)
    ]


def _is_accepted(case: PeerCase) -> bool:
    return case.judgement is not None and case.judgement.status is Status.OK


def _spread(values: Iterable[float]) -> str:
    spread = spread_of(values)
    if spread is None:
        return "-"
    return f"{spread.median:.3f} / {spread.p95:.3f} / {spread.maximum:.3f}"
