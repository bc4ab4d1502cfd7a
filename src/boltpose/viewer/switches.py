"""The tab with which a person chooses what is shown, in which colours, and from where."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Protocol

from boltpose.picture.bolt_marks import Ink
from boltpose.report.markup import Html, join
from boltpose.viewer.bolts import BoltLayer
from boltpose.viewer.page import Page
from boltpose.viewer.panel import color_legend
from boltpose.viewer.panel_bolts import mark_legend
from boltpose.viewer.scan_colors import ColorMode, legend
from boltpose.viewer.scan_layer import ScanLayer
from boltpose.viewer.setting import Setting


class PriorPart(StrEnum):
    """How much of the registered prior is shown; the text is what the page shows."""

    UNSEEN = "where nothing was measured"
    ALL = "all of it"
    NONE = "hidden"


class Switched(Protocol):
    """What the switches act on."""

    page: Page
    scan: ScanLayer
    bolts: BoltLayer
    setting: Setting

    @property
    def labels_from_file(self) -> bool:
        """True if the parts shown come from labels in the scan's file."""
        ...

    def recolor(self, mode: ColorMode) -> None:
        """Colour the scan."""

    def prior_legend(self, mode: ColorMode) -> list[tuple[str, str]]:
        """Colour and meaning of the registered prior; nothing if there is none."""
        ...

    def show_prior(self) -> None:
        """Show as much of the prior as `Switches.prior_part` says."""

    def look(self, where: str) -> None:
        """Put the viewer somewhere."""


class Switches:
    """Check boxes, colours, places to look from; they keep their state from scan to scan."""

    def __init__(self, on: Switched) -> None:
        """Add them to the tab that is open."""
        self._on = on
        page, gui = on.page, on.page.server.gui
        self._mode = gui.add_dropdown(
            "Scan colours",
            tuple(str(mode) for mode in ColorMode),
            initial_value=str(ColorMode.PARTS),
        )
        self._inks: list[Ink] = []
        self._wished = ColorMode.PARTS
        self._is_offering = False
        boxes = (
            ("Scan", True, on.scan.set_visible),
            ("Bolts", True, on.bolts.set_visible),
            ("Names", True, on.bolts.set_labels),
            ("Robot base", True, on.setting.set_base),
            ("Camera", True, on.setting.set_camera),
            ("Fewer points", False, on.scan.set_light),
        )
        for label, initial, switch in boxes:
            box = gui.add_checkbox(label, initial)
            box.on_update(lambda event, switch=switch: page.do(switch, event.target.value))
        self._prior = gui.add_dropdown(
            "Registered prior",
            [str(part) for part in PriorPart],
            initial_value=str(PriorPart.UNSEEN),
        )
        self._prior.on_update(lambda _: page.do(on.show_prior))
        self._sigma = gui.add_checkbox(
            "Sigma ellipsoids", False, hint="1 sigma of each head's place, enlarged"
        )
        self._times = gui.add_slider("enlarged", min=1, max=100, step=1, initial_value=20)
        self._sigma.on_update(lambda _: page.do(self._ellipsoids))
        self._times.on_update(lambda _: page.do(self._ellipsoids))
        self._mode.on_update(lambda _: page.do(self._recolor))
        places = gui.add_button_group("Look", ("motor", "behind", "camera", "all"))
        places.on_click(lambda event: page.do(on.look, event.target.value))
        self._legend = page.add_html()

    @property
    def prior_part(self) -> PriorPart:
        """How much of the registered prior is wanted."""
        return PriorPart(self._prior.value)

    def offer(self, modes: Sequence[ColorMode], inks: Sequence[Ink]) -> ColorMode:
        """Offer these colours; the one chosen last is kept where it is among them."""
        mode = self._wished if self._wished in modes else modes[0]
        self._is_offering = True
        self._mode.options = tuple(str(one) for one in modes)
        self._mode.value = str(mode)
        self._is_offering = False
        self._inks = [ink for ink in Ink if ink in inks]
        self.explain(self._inks, mode)
        return mode

    def explain(self, inks: Sequence[Ink], mode: ColorMode | None) -> None:
        """Say what colours and marks mean."""
        parts: list[Html | None] = [mark_legend(inks)]
        if mode is not None:
            entries = legend(mode, from_file=self._on.labels_from_file)
            parts.append(color_legend([*entries, *self._on.prior_legend(mode)], "Surfaces"))
        self._legend.show(join(parts))

    def _recolor(self) -> None:
        if self._is_offering:
            return
        mode = ColorMode(self._mode.value)
        self._wished = mode
        self._on.recolor(mode)
        self.explain(self._inks, mode)

    def _ellipsoids(self) -> None:
        self._on.bolts.set_ellipsoids(self._sigma.value, float(self._times.value))
