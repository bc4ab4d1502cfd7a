"""A prior in the page: its surface, its bolts and what is known of each."""

from __future__ import annotations

from pathlib import Path

from boltpose.geometry.transforms import Transform
from boltpose.prior.file import read_prior
from boltpose.report.markup import Html, join, number, percent, tag
from boltpose.schema import Prior, PriorBolt
from boltpose.viewer.page import Page
from boltpose.viewer.panel import box
from boltpose.viewer.panel_style import STYLE
from boltpose.viewer.prior_scene import PriorScene


def show_prior(page: Page, path: Path) -> PriorScene:
    """Show a prior to look at; nothing can be changed.

    Args:
        page: An empty one.
        path: The `.prior.npz`.

    Raises:
        InputFileError: It cannot be read.
    """
    prior = read_prior(path)
    scene = PriorScene(page)
    page.headline.show(join([STYLE, prior_headline(prior)]))
    with page.tab("Bolts"):
        page.add_html().show(prior_table(prior))
        detail = page.add_html()
    detail.show(box(tag("p", "Click a bolt in the picture.")))
    scene.bolts.on_click(lambda bolt_id: detail.show(prior_bolt_detail(prior.bolt(bolt_id))))
    scene.show(prior)
    scene.look_from_above()
    return scene


def prior_headline(prior: Prior) -> Html:
    """Name, number of bolts, and how many of them a person should look at."""
    unsure = sum(not bolt.is_sure for bolt in prior.bolts)
    text = f"{len(prior.bolts)} bolts" + (f", {unsure} to be looked at" if unsure else ", all sure")
    kind = "wait" if unsure else "ok"
    return box(tag("div", tag("b", prior.name), tag("span", text), class_=f"verdict {kind}"))


def prior_table(prior: Prior) -> Html:
    """One row per bolt."""
    head = ("bolt", "confidence", "head mm", "1 sigma mm")
    rows = (
        tag(
            "tr",
            tag("td", tag("b", bolt.id), f" {bolt.name}", "" if bolt.is_sure else " ?"),
            tag("td", percent(bolt.confidence), class_="n"),
            tag("td", number(bolt.head_diameter_mm, 1), class_="n"),
            tag("td", number(bolt.sigma_lateral_mm, 2), class_="n"),
            class_=None if bolt.is_sure else "missed",
        )
        for bolt in prior.bolts
    )
    return box(
        tag(
            "table",
            tag("thead", tag("tr", *(tag("th", text) for text in head))),
            tag("tbody", *rows),
        )
    )


def prior_bolt_detail(bolt: PriorBolt) -> Html:
    """All that is known of one bolt."""
    place: Transform = bolt.prior_from_bolt
    rows = [
        ("side", str(bolt.side)),
        ("head top", "  ".join(number(float(value), 2) for value in place.translation_mm) + " mm"),
        ("axis", "  ".join(number(float(value), 4) for value in place.z_axis)),
        ("head", f"{number(bolt.head_diameter_mm, 1)} x {number(bolt.head_height_mm, 1)} mm"),
        ("confidence", percent(bolt.confidence)),
        ("tool", bolt.tool or "not said"),
        ("turn", "not said" if bolt.order is None else str(bolt.order)),
        *(("remark", remark) for remark in bolt.remarks),
    ]
    return box(
        tag("h3", f"{bolt.id} {bolt.name}".strip()),
        tag(
            "table",
            tag("tbody", *(tag("tr", tag("td", name), tag("td", text)) for name, text in rows)),
            data_bolt=bolt.id,
        ),
    )
