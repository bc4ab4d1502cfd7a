"""What the review page says: where one stands, the bolt at hand, all bolts. Text in, HTML out."""

from __future__ import annotations

import math
from collections.abc import Sequence

from boltpose.prior.review import review_order
from boltpose.prior.review_edits import (
    AddBolt,
    ConfirmBolt,
    Edit,
    FlipBolt,
    NameBolt,
    RemoveBolt,
    SetOrders,
    SetTool,
)
from boltpose.report.markup import Html, clip, join, percent, tag
from boltpose.schema import Prior, PriorBolt
from boltpose.viewer.panel_style import STYLE

_WORDS = 40


def unsure_count(prior: Prior) -> int:
    """How many bolts a person still has to look at."""
    return sum(not bolt.is_sure for bolt in prior.bolts)


def headline(prior: Prior, *, state: str, is_adding: bool) -> Html:
    """On top of the panel: how far the review is, and what the next click does.

    Args:
        prior: As it is now.
        state: Whether it is saved, in words.
        is_adding: The next click adds a bolt.
    """
    left = unsure_count(prior)
    if is_adding:
        kind, word, text = "busy", "CLICK", "Click on the head that was missed."
    elif left:
        noun = "bolt" if left == 1 else "bolts"
        kind, word = "wait", f"{left} to check"
        text = f"{left} {noun} of {len(prior.bolts)} unsure. Look at each: is the ring on its head?"
    else:
        kind, word = "ok", "All sure"
        text = f"{len(prior.bolts)} bolts, each of them sure. Is one missing? Add it. Then save."
    return join(
        [
            STYLE,
            tag(
                "div",
                tag(
                    "div",
                    tag("b", word),
                    tag("span", text),
                    tag("span", f"prior {clip(prior.name, 60)}: {state}", class_="of"),
                    class_=f"verdict {kind}",
                    role="status",
                ),
                class_="bp",
            ),
        ]
    )


def bolt_card(prior: Prior, bolt_id: str | None) -> Html:
    """The bolt at hand: how sure it is and why not, in words, then its numbers."""
    bolt = next((entry for entry in prior.bolts if entry.id == bolt_id), None)
    if bolt is None:
        return _box(tag("p", "No bolt is chosen. Click on one, or press Next."))
    place = [entry.id for entry in review_order(prior)].index(bolt.id) + 1
    title = tag(
        "h3", bolt_title(bolt), " ", tag("small", f"{place} of {len(prior.bolts)}, {bolt.side}")
    )
    if bolt.is_sure:
        doubt = tag("p", "sure, confidence ", percent(bolt.confidence))
    else:
        doubt = tag(
            "div",
            tag("b", f"Unsure: confidence {percent(bolt.confidence)}"),
            join((f"{remark}." for remark in bolt.remarks), " "),
            class_="reason",
        )
    remarks = tag("small", "; ".join(bolt.remarks)) if bolt.is_sure and bolt.remarks else None
    numbers = tag(
        "p",
        tag(
            "small",
            f"head {bolt.head_diameter_mm:.1f} mm wide, {bolt.head_height_mm:.1f} mm high; "
            f"1 sigma {_up(bolt.sigma_lateral_mm)} mm beside the axis, "
            f"{_up(bolt.sigma_axial_mm)} mm along it",
        ),
    )
    return _box(title, doubt, remarks, numbers)


def bolt_table(prior: Prior, chosen: str | None) -> Html:
    """One row per bolt, unsure ones first, as the review goes through them."""
    rows = [
        tag(
            "tr",
            tag("td", tag("b", bolt.id) if bolt.id == chosen else bolt.id),
            tag("td", clip(bolt.name, 24)),
            tag("td", clip(bolt.tool, 16)),
            tag("td", "" if bolt.order is None else bolt.order, class_="n"),
            tag("td", "sure" if bolt.is_sure else percent(bolt.confidence), class_="n"),
            class_=None if bolt.is_sure else "missed",
        )
        for bolt in review_order(prior)
    ]
    heads = [tag("th", word) for word in ("bolt", "name", "tool")]
    heads += [tag("th", word, class_="n") for word in ("turn", "")]
    return _box(tag("table", tag("thead", tag("tr", *heads)), tag("tbody", *rows)))


def bolt_title(bolt: PriorBolt) -> str:
    """Its id, and its name if it has one."""
    return f"{bolt.id} {clip(bolt.name, _WORDS)}" if bolt.name else bolt.id


def choices(prior: Prior) -> dict[str, str]:
    """What the list of bolts offers, in the order of the review, with the id behind it."""
    options = {
        f"{bolt_title(bolt)} ({'sure' if bolt.is_sure else percent(bolt.confidence)})": bolt.id
        for bolt in review_order(prior)
    }
    return options


def measured_words(bolt: PriorBolt) -> tuple[bool, str]:
    """Whether a new bolt's head was measured well, and what to say about it."""
    if bolt.is_sure:
        return True, (
            f"{bolt.id} ({bolt.side}): head {bolt.head_diameter_mm:.1f} mm wide, "
            f"its axis known to {_up(bolt.sigma_lateral_mm)} mm (1 sigma)."
        )
    return False, (
        f"{bolt.id} ({bolt.side}) is unsure: {'; '.join(bolt.remarks)}. "
        "Look closely. Confirm it if the ring is on the head, else undo."
    )


def edit_words(edit: Edit) -> str:
    """An edit in a few words, for the undo button."""
    match edit:
        case AddBolt():
            return "add a bolt"
        case RemoveBolt():
            return f"remove {edit.bolt}"
        case ConfirmBolt():
            return f"confirm {edit.bolt}"
        case FlipBolt():
            return f"turn {edit.bolt} round"
        case NameBolt():
            return f"name of {edit.bolt}"
        case SetTool():
            return f"tool of {_several(edit.bolts)}"
        case SetOrders():
            return f"turn of {_several([bolt for bolt, _ in edit.orders])}"


def _several(bolts: Sequence[str]) -> str:
    return bolts[0] if len(bolts) == 1 else f"{len(bolts)} bolts"


def _up(value_mm: float) -> str:
    """Rounded up: no bolt looks better than it is."""
    return f"{math.ceil(value_mm * 100 - 1e-9) / 100:.2f}"


def _box(*children: Html | None) -> Html:
    return tag("div", *children, class_="bp")
