"""The review of a prior in the browser: the session's edits, made by clicks."""

from __future__ import annotations

import time
from pathlib import Path

from boltpose.errors import ConfigError
from boltpose.prior.review import ReviewSession, review_order
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
from boltpose.prior.review_words import clean_words
from boltpose.schema import Prior, PriorBolt
from boltpose.viewer.config import ViewerConfig
from boltpose.viewer.page import Page, SurfaceClick
from boltpose.viewer.prior_scene import PriorScene
from boltpose.viewer.review_panel import ReviewPanel, Words
from boltpose.viewer.review_texts import (
    bolt_card,
    bolt_table,
    choices,
    edit_words,
    headline,
    measured_words,
    unsure_count,
)
from boltpose.viewer.review_view import look_from

_SETTLE_S = 0.15
"""The browser sends what is typed up to 50 ms late, so a button may be heard of first."""
_PATIENCE_S = 2.0
"""After Enter it is waited so long for something typed: a browser that draws slowly is later."""
_SAME_SIZE_MM = 0.5
"""Heads whose spanner sizes differ by less take the same tool; sizes are 1 mm apart or more."""


class ReviewPage:
    """A page on one review session; every browser shows the same, and may come and go."""

    def __init__(
        self,
        session: ReviewSession,
        config: ViewerConfig | None = None,
        *,
        by: str = "",
        date: str = "",
        output: Path | None = None,
    ) -> None:
        """Serve the page.

        Args:
            session: Held by the caller, who closes it after the page.
            config: Settings.
            by: Who reviews; can be changed in the page.
            date: When; written into the prior only if given.
            output: Where the prior is saved; by default it is replaced.

        Raises:
            ConfigError: The port is taken.
        """
        self.session = session
        self.page = Page(f"Prior {session.prior.name}", config)
        self.saved: list[Path] = []
        self._date = date
        self._output = output
        self._is_adding = False
        self._looked_at: set[str] = set()
        self._scene = PriorScene(self.page)
        self._panel = ReviewPanel(self.page, self, by=by)
        self._chosen: str | None = None
        self._scene.bolts.on_click(self.choose)
        self.page.on_surface_click(self._clicked)
        self.page.do(self._begin)

    def choose(self, bolt_id: str) -> None:
        """Look at a bolt; what was typed for the one before is set first."""
        if bolt_id != self._chosen:
            self._set_typed()
        self._select(bolt_id)

    def confirm(self) -> None:
        """The bolt at hand is right; go on to the next."""
        bolt = self._bolt()
        self._set_typed()
        if not bolt.is_sure:
            self.session.do(ConfirmBolt(bolt=bolt.id))
        self._looked_at.add(bolt.id)
        self._select(self._next_after(bolt.id))

    def remove(self) -> None:
        """The bolt at hand is none; go on to the next."""
        bolt = self._bolt()
        following = self._next_after(bolt.id)
        self.session.do(RemoveBolt(bolt=bolt.id))
        self._select(following if following != bolt.id else None)

    def flip(self) -> None:
        """The head of the bolt at hand looks the other way."""
        self._set_typed()
        made = self.session.do(FlipBolt(bolt=self._bolt().id))
        # a guess may look into the motor: then the view stays
        self._announce(made, "Turned", moves_view=made is not None and made.is_sure)

    def go_on(self) -> None:
        """Look at the next bolt, whatever this one is."""
        self._set_typed()
        if self._chosen is not None:
            self._looked_at.add(self._chosen)
        self._select(self._next_after(self._chosen))

    def toggle_adding(self) -> None:
        """The next click on the motor adds a bolt; pressed again it does not."""
        self._set_typed()
        self._is_adding = not self._is_adding
        self._refresh()

    def set_words(self) -> None:
        """Take over name, tool and turn as typed."""
        self._bolt()
        self._set_typed(_PATIENCE_S)
        self._refresh()

    def set_words_of(self, bolt_id: str) -> None:
        """Take over what was typed for a bolt that is no longer at hand."""
        self._set_words_of(bolt_id)
        self._refresh()

    def take_next_turn(self) -> None:
        """Give the bolt at hand the turn after the last one given."""
        bolt = self._bolt()
        self._set_typed()
        taken = [other.order or 0 for other in self.session.prior.bolts if other.id != bolt.id]
        self._do(SetOrders(orders=((bolt.id, max(taken, default=0) + 1),)))

    def spread_tool(self) -> None:
        """Give the tool of the bolt at hand to every bolt with a head of that size."""
        bolt = self._bolt()
        self._set_typed()
        tool = self._bolt().tool
        if not tool:
            raise ConfigError(f"type a tool for {bolt.id} first")
        same = tuple(
            other.id
            for other in self.session.prior.bolts
            if abs(other.head_diameter_mm - bolt.head_diameter_mm) < _SAME_SIZE_MM
            and other.tool != tool
        )
        if not same:
            raise ConfigError(f"every bolt with a head like {bolt.id} has this tool already")
        self._do(SetTool(bolts=same, tool=tool))
        self.page.tell(
            "info",
            "Tool set",
            f"'{tool}' also for {', '.join(same)}: heads as wide as {bolt.id}. Is one of another "
            "shape? Type its own tool.",
            12.0,
        )

    def undo(self) -> None:
        """Take the last edit back, and look at the bolt it was about."""
        self._set_typed()
        before = self.session.prior
        self.session.undo()
        self._after_history(before)

    def redo(self) -> None:
        """Make the edit again that was undone last."""
        before = self.session.prior
        self.session.redo()
        self._after_history(before)

    def save(self) -> None:
        """Write the prior."""
        self._set_typed()
        path = self.session.save(by=self._panel.by, date=self._date, output=self._output)
        self.saved.append(path)
        left = unsure_count(self.session.prior)
        rest = f" {left} still unsure: locate will say so." if left else ""
        self.page.tell("good", "Saved", f"{path.name} is written.{rest}")
        self._refresh()

    def show_all(self) -> None:
        """Look at the whole motor."""
        self._scene.look_from_above()

    def end(self) -> None:
        """Close the page; edits that were not saved stay in the journal."""
        self.page.tell("info", "The review has ended", "You can close this page.")
        self.page.stop()

    def _begin(self) -> None:
        self._scene.show(self.session.prior)
        self._scene.look_from_above()
        order = review_order(self.session.prior)
        self._select(order[0].id if order else None)

    def _clicked(self, click: SurfaceClick) -> None:
        if not self._is_adding:
            return
        x, y, z = (float(value) for value in click.point_mm)
        made = self.session.do(AddBolt(position_mm=(x, y, z)))
        self._is_adding = False
        # the person is looking there
        self._announce(made, "Added", moves_view=False)

    def _announce(self, made: PriorBolt | None, title: str, *, moves_view: bool) -> None:
        assert made is not None  # both edits make one
        is_good, text = measured_words(made)
        self.page.tell("good" if is_good else "error", title, text, 12.0)
        self._select(made.id, moves_view=moves_view)

    def _do(self, edit: Edit) -> None:
        self.session.do(edit)
        self._refresh()

    def _bolt(self) -> PriorBolt:
        if self._chosen is None:
            raise ConfigError("choose a bolt first: click on it, or take it from the list")
        return self.session.prior.bolt(self._chosen)

    def _next_after(self, bolt_id: str | None) -> str | None:
        """Unsure bolts not looked at, then the others in the order of the list."""
        order = [bolt.id for bolt in review_order(self.session.prior)]
        doubtful = [
            bolt.id
            for bolt in review_order(self.session.prior)
            if not bolt.is_sure and bolt.id not in self._looked_at and bolt.id != bolt_id
        ]
        if doubtful:
            return doubtful[0]
        if bolt_id not in order:
            return order[0] if order else None
        return order[(order.index(bolt_id) + 1) % len(order)]

    def _set_typed(self, patience_s: float = _SETTLE_S) -> None:
        """Make edits of what was typed for the bolt at hand."""
        if self._chosen is None:
            return
        deadline = time.monotonic() + patience_s
        time.sleep(min(_SETTLE_S, patience_s))
        while self._panel.typed(self._chosen) is None and time.monotonic() < deadline:
            time.sleep(_SETTLE_S)
        if patience_s > _SETTLE_S:
            time.sleep(_SETTLE_S)  # the other fields come along
        self._set_words_of(self._chosen)

    def _set_words_of(self, bolt_id: str) -> None:
        """One edit for each field that changed."""
        words = self._panel.typed(bolt_id)
        bolt = next((entry for entry in self.session.prior.bolts if entry.id == bolt_id), None)
        if words is None or bolt is None:
            return
        turn = _as_turn(words.turn)
        if clean_words(words.name, "a name") != bolt.name:
            self.session.do(NameBolt(bolt=bolt_id, name=words.name))
        if clean_words(words.tool, "a tool") != bolt.tool:
            self.session.do(SetTool(bolts=(bolt_id,), tool=words.tool))
        if turn != bolt.order:
            self._set_turn(bolt, turn)
        self._panel.settle(bolt_id, _words_of(self.session.prior.bolt(bolt_id)))

    def _set_turn(self, bolt: PriorBolt, turn: int | None) -> None:
        """A turn that another bolt has is exchanged: taking one away is no one's wish."""
        prior = self.session.prior
        holder = next((b for b in prior.bolts if turn is not None and b.order == turn), None)
        if holder is None:
            self.session.do(SetOrders(orders=((bolt.id, turn),)))
            return
        self.session.do(SetOrders(orders=((bolt.id, turn), (holder.id, bolt.order))))
        theirs = "none now" if bolt.order is None else f"{bolt.order} now"
        self.page.tell("info", "Turns exchanged", f"{bolt.id} has {turn}, {holder.id} has {theirs}")

    def _after_history(self, before: Prior) -> None:
        after = self.session.prior
        known = {bolt.id: bolt for bolt in before.bolts}
        changed = [bolt.id for bolt in after.bolts if known.get(bolt.id) is not bolt]
        self._looked_at.difference_update(changed)
        is_there = self._chosen in {bolt.id for bolt in after.bolts}
        if len(changed) == 1 or (changed and not is_there):
            self._select(changed[0])
        else:  # of an edit of several bolts one is as good as the other: the view stays
            self._select(self._chosen if is_there else self._next_after(None))

    def _select(self, bolt_id: str | None, *, moves_view: bool = True) -> None:
        if bolt_id is not None and bolt_id not in {bolt.id for bolt in self.session.prior.bolts}:
            bolt_id = None
        is_other = bolt_id != self._chosen
        self._chosen = bolt_id
        self._refresh()
        if bolt_id is not None and is_other and moves_view:
            bolt = self._bolt()
            self.page.look_at(
                bolt.prior_from_bolt.translation_mm, look_from(self.session.prior, bolt)
            )

    def _state(self) -> str:
        if not self.session.has_unsaved:
            return "saved" if self.saved else "nothing changed yet"
        taken_up = self.session.resumed_edits
        more = f"; edits of an earlier review taken up: {taken_up}" if taken_up else ""
        return f"not saved yet; nothing is lost if you close this page{more}"

    def _refresh(self) -> None:
        session, prior = self.session, self.session.prior
        bolt = next((entry for entry in prior.bolts if entry.id == self._chosen), None)
        with self.page.server.atomic():
            self._scene.show(prior)
            self._scene.bolts.choose(self._chosen)
            # str: viser sends plain text only
            self.page.headline.content = str(
                headline(
                    prior,
                    state=self._state(),
                    is_adding=self._is_adding,
                )
            )
            self._panel.card.content = str(bolt_card(prior, self._chosen))
            self._panel.table.content = str(bolt_table(prior, self._chosen))
            self._panel.show_choices(choices(prior), self._chosen)
            self._panel.forget_all_but([entry.id for entry in prior.bolts])
            self._panel.show_words(self._chosen, _words_of(bolt))
            self._panel.show_adding(self._is_adding)
            self._panel.enable(
                has_bolt=bolt is not None,
                can_confirm=bolt is not None and not bolt.is_sure,
                undo=edit_words(session.edits[-1]) if session.edits else None,
                save=session.has_unsaved,
            )


def _words_of(bolt: PriorBolt | None) -> Words:
    if bolt is None:
        return Words(name="", tool="", turn="")
    turn = "" if bolt.order is None else str(bolt.order)
    return Words(name=bolt.name, tool=bolt.tool, turn=turn)


def _as_turn(text: str) -> int | None:
    if not text.strip():
        return None
    try:
        return int(text)
    except ValueError:
        raise ConfigError(f"the turn must be a number from 1, got '{text}'") from None
