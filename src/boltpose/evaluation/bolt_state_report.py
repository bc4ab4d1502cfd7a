"""The sections of the report on lost, exchanged and surplus bolts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from boltpose.evaluation.bolt_state import SETS, read_set
from boltpose.evaluation.bolt_state_cases import Fate
from boltpose.evaluation.tables import markdown_table
from boltpose.schema import BoltState

VISIBLE = 0.25
"""Share of a head that makes it visible, as `locate` reports it."""
BIG_HIGHER_MM = 0.8
BIG_WIDER_MM = 1.4
_NAMES = {
    "reman18": "reman18, thresholds chosen here",
    "changed": "many changes, thresholds chosen here",
    "changed_test": "many changes, test",
    "factory": "factory scenes, one threshold moved after a first look",
}
_STEPS_MM = ((0.0, 0.3), (0.3, 0.6), (0.6, 1.0), (1.0, 1.5), (1.5, 9.0))

Bolt = dict[str, Any]


def sections(results: Path) -> list[str]:
    """Render what was measured.

    Args:
        results: Folder that may hold `bolt_state/<set>.json`.

    Returns:
        Markdown sections, none if nothing was measured.

    Raises:
        InputFileError: A file is damaged.
    """
    views = {name: found for name in SETS if (found := read_set(results, name)) is not None}
    if not views:
        return []
    bolts = {name: [bolt for view in of for bolt in view["bolts"]] for name, of in views.items()}
    everything = [bolt for name in ("changed", "changed_test") for bolt in bolts.get(name, [])]
    parts = [
        "## Bolts that are missing, others or surplus (simulated)",
        "Every bolt of the prior is `confirmed`, `unseen` or `contradicted` by the lines of sight "
        "to its head. True poses were put off by 0.1 to 0.2 mm in depth, 0.05 mm beside and "
        "0.02 degrees before. *Visible* is a head of which the camera measured at least "
        f"{100 * VISIBLE:.0f} % (of a lost one: as long as it was there, from the same place). A "
        f"head is *clearly other* if it is at least {BIG_HIGHER_MM} mm higher or lower or "
        f"{BIG_WIDER_MM} mm wider or narrower. Made by `python -m boltpose.evaluation.bolt_state`.",
        _table(bolts),
        _by_difference(everything),
        "A lost screw that stays `unseen` was seen edge-on with nothing measurable behind it, or "
        "leaves a hole too deep and dark to be measured: no measurement is no evidence, a dark or "
        "greasy head gives none either. A screw whose head differs by less is `confirmed`.",
        _extra(views),
        "![Bolts that are there, lost and exchanged, as a simulated camera sees them]"
        "(images/bolt_state.png)",
    ]
    return [part for part in parts if part]


def _table(bolts: dict[str, list[Bolt]]) -> str:
    rows = [
        [
            _NAMES[name],
            _share(of, _is_kept, BoltState.CONFIRMED),
            _share(of, _is_kept, BoltState.CONTRADICTED),
            _all_false(of),
            _share(of, _is_lost, BoltState.CONTRADICTED),
            _share(of, _is_other, BoltState.CONTRADICTED),
            _share(of, _is_alike, BoltState.CONTRADICTED),
        ]
        for name, of in bolts.items()
    ]
    header = [
        "set",
        "unchanged, visible: confirmed",
        "contradicted",
        "unchanged, all: contradicted",
        "lost, visible: contradicted",
        "clearly other head, visible: contradicted",
        "slightly other head, visible: contradicted",
    ]
    return markdown_table(header, rows)


def _by_difference(bolts: Sequence[Bolt]) -> str:
    replaced = [bolt for bolt in bolts if bolt["fate"] == Fate.REPLACED and _is_visible(bolt)]
    if not replaced:
        return ""
    rows: list[list[str]] = []
    for low, high in _STEPS_MM:
        row = [f"{low:.1f} to {high:.1f}" if high < 9 else f"from {low:.1f}"]
        for narrow in (True, False):
            told = [
                bolt["state"] == BoltState.CONTRADICTED
                for bolt in replaced
                if low <= abs(bolt["higher_mm"]) < high
                and (abs(bolt["wider_mm"]) < BIG_WIDER_MM) == narrow
            ]
            row.append(_of(sum(told), len(told)))
        rows.append(row)
    header = [
        "another head, difference in height in mm",
        f"told, width within {BIG_WIDER_MM} mm",
        f"told, width {BIG_WIDER_MM} mm or more apart",
    ]
    return markdown_table(header, rows)


def _extra(views: dict[str, list[dict[str, Any]]]) -> str:
    found = [head for of in views.values() for view in of for head in view["found"]]
    surplus = [head for of in views.values() for view in of for head in view["surplus"]]
    right = sum(head["is_true"] for head in found)
    told = [
        f"{_of(sum(h['is_found'] for h in among), len(among))} {name}"
        for name, among in (
            ("of which half or more was measured", _seen(surplus, 0.5, 1.01)),
            ("of which a quarter to a half was", _seen(surplus, 0.25, 0.5)),
        )
    ]
    if not surplus:
        return ""
    count = sum(len(of) for of in views.values())
    return (
        f"Surplus heads, in {count} views: {len(found)} reported, {right} of them bolts "
        "that are there and not in the prior; what else is reported are the screws with which "
        "clamps of the kind `flange_plate` hold the motor by its flange. "
        f"Found were {' and '.join(told)}."
    )


def _seen(surplus: Sequence[dict[str, Any]], low: float, high: float) -> list[dict[str, Any]]:
    return [head for head in surplus if low <= head["visible_fraction"] < high]


def _is_visible(bolt: Bolt) -> bool:
    return max(bolt["visible_before"], bolt["visible_after"]) >= VISIBLE


def _is_kept(bolt: Bolt) -> bool:
    return bolt["fate"] == Fate.KEPT


def _is_lost(bolt: Bolt) -> bool:
    return bolt["fate"] == Fate.LOST


def _is_other(bolt: Bolt) -> bool:
    return bolt["fate"] == Fate.REPLACED and (
        abs(bolt["higher_mm"]) >= BIG_HIGHER_MM or abs(bolt["wider_mm"]) >= BIG_WIDER_MM
    )


def _is_alike(bolt: Bolt) -> bool:
    return bolt["fate"] == Fate.REPLACED and not _is_other(bolt)


def _share(bolts: Sequence[Bolt], which: Callable[[Bolt], bool], state: BoltState) -> str:
    among = [bolt for bolt in bolts if which(bolt) and _is_visible(bolt)]
    return _of(sum(bolt["state"] == state for bolt in among), len(among))


def _all_false(bolts: Sequence[Bolt]) -> str:
    kept = [bolt for bolt in bolts if _is_kept(bolt)]
    return _of(sum(bolt["state"] == BoltState.CONTRADICTED for bolt in kept), len(kept))


def _of(count: int, total: int) -> str:
    return f"{count} of {total}" if total else "-"
