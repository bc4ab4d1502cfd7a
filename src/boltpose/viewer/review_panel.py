"""The widgets of the review: what a person presses and types. They know no prior."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from boltpose.viewer.page import Page
from boltpose.viewer.web import viser

NOTHING: str = "no bolt"
"""What the list of bolts offers where there is none."""
_WHOLE = "Whole motor"
_END = "End the review"


class ReviewActions(Protocol):
    """What the widgets ask for; each is called on the page's thread."""

    def choose(self, bolt_id: str) -> None:
        """Look at a bolt."""

    def confirm(self) -> None:
        """The bolt at hand is right."""

    def remove(self) -> None:
        """It is no bolt."""

    def flip(self) -> None:
        """Its head looks the other way."""

    def go_on(self) -> None:
        """Look at the next one."""

    def toggle_adding(self) -> None:
        """The next click on the motor adds a bolt, or no longer does."""

    def set_words(self) -> None:
        """Take over name, tool and turn as typed."""

    def take_next_turn(self) -> None:
        """Give the bolt at hand the next free turn."""

    def spread_tool(self) -> None:
        """Give the tool to every bolt with a head of that size."""

    def undo(self) -> None:
        """Take the last edit back."""

    def redo(self) -> None:
        """Make it again."""

    def save(self) -> None:
        """Write the prior."""

    def show_all(self) -> None:
        """Look at the whole motor."""

    def end(self) -> None:
        """Close the page and end the program."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """What is typed at the moment."""

    name: str
    tool: str
    turn: str


class ReviewPanel:
    """One tab with everything a review needs, from top to bottom in the order of the work."""

    def __init__(self, page: Page, actions: ReviewActions, *, by: str) -> None:
        """Build the tab.

        Args:
            page: Where it is shown.
            actions: Called on the page's thread.
            by: Already in the field for the person's name.
        """
        self._page = page
        self._ids: Mapping[str, str] = {}
        self._shown = Words(name="", tool="", turn="")
        gui = page.server.gui
        with page.tab("Review"):
            self.card = gui.add_html("")
            self._confirm = self._button("Confirm: this is right", "C", "green", actions.confirm)
            self._remove = self._button("Remove: no bolt", "X", "red", actions.remove)
            self._flip = self._button("Turn to the other side", "F", "gray", actions.flip)
            self._next = self._button("Next", "N", "gray", actions.go_on)
            self._list: viser.GuiDropdownHandle[str] = gui.add_dropdown("Bolt", (NOTHING,))
            with gui.add_form(None) as form:
                self._name = gui.add_text("Name", "", hint="What people call it; Enter sets it.")
                self._tool = gui.add_text("Tool", "", hint="In your own words, such as hex 8.")
                self._turn = gui.add_text("Turn", "", hint="1 is taken out first; empty: none.")
            words = gui.add_button_group("", ("Set", "Next free turn", "Tool for this size"))
            self.add = self._button("Add a missed bolt", "B", "blue", actions.toggle_adding)
            self.table = gui.add_html("")
            self._undo = self._button("Undo", None, "gray", actions.undo)
            self._redo = self._button("Redo", None, "gray", actions.redo)
            self._by = gui.add_text("Your name", by, hint="Goes into the prior.")
            self._save = self._button("Save", None, "green", actions.save)
            other = gui.add_button_group("", (_WHOLE, _END))
        form.on_submit(lambda _: page.do(actions.set_words))
        self._list.on_update(lambda event: self._picked(event, actions))
        group: dict[str, Callable[[], None]] = {
            "Set": actions.set_words,
            "Next free turn": actions.take_next_turn,
            "Tool for this size": actions.spread_tool,
        }
        words.on_click(lambda event: page.do(group[event.target.value]))
        others = {_WHOLE: actions.show_all, _END: actions.end}
        other.on_click(lambda event: page.do(others[event.target.value]))
        self._command("Undo", "Z", "cmd/ctrl", actions.undo)
        self._command("Redo", "Y", "cmd/ctrl", actions.redo)
        self._form = form

    @property
    def by(self) -> str:
        """Who the person says to be."""
        return self._by.value

    @property
    def words(self) -> Words:
        """Name, tool and turn as typed."""
        return Words(name=self._name.value, tool=self._tool.value, turn=self._turn.value)

    @property
    def has_typed(self) -> bool:
        """Whether something was typed and not yet set."""
        return self.words != self._shown

    def show_words(self, words: Words) -> None:
        """Fill the fields."""
        self._shown = words
        self._name.value, self._tool.value, self._turn.value = words.name, words.tool, words.turn

    def show_choices(self, ids: Mapping[str, str], chosen: str | None) -> None:
        """Fill the list of bolts: id by what is shown."""
        self._ids = ids
        options = tuple(ids) or (NOTHING,)
        if self._list.options != options:
            self._list.options = options
        wanted = [text for text, bolt_id in ids.items() if bolt_id == chosen]
        self._list.value = wanted[0] if wanted else options[0]

    def show_adding(self, is_adding: bool) -> None:
        """Say on the button what a click on it does now."""
        self.add.label = "Add no bolt after all  [B]" if is_adding else "Add a missed bolt  [B]"

    def enable(
        self, *, has_bolt: bool, can_confirm: bool, undo: str | None, redo: str | None, save: bool
    ) -> None:
        """Let only those buttons be pressed that can do something.

        Args:
            has_bolt: A bolt is chosen.
            can_confirm: It is unsure.
            undo: What would be undone; None for nothing.
            redo: The same for redo.
            save: Something can be saved.
        """
        self._confirm.disabled = not can_confirm
        for widget in (self._remove, self._flip, self._name, self._tool, self._turn):
            widget.disabled = not has_bolt
        self._undo.label = "Undo" if undo is None else f"Undo: {undo}"
        self._undo.disabled = undo is None
        self._redo.label = "Redo" if redo is None else f"Redo: {redo}"
        self._redo.disabled = redo is None
        self._save.disabled = not save

    def _picked(self, event: viser.GuiEvent[Any], actions: ReviewActions) -> None:
        bolt_id = self._ids.get(self._list.value)
        if event.client_id is not None and bolt_id:  # else it was us who changed the list
            self._page.do(actions.choose, bolt_id)

    def _button(
        self,
        label: str,
        key: Any,
        color: Any,
        action: Callable[[], None],
    ) -> viser.GuiButtonHandle:
        text = label if key is None else f"{label}  [{key}]"
        button = self._page.server.gui.add_button(text, color=color)
        button.on_click(lambda _: self._page.do(action))
        if key is not None:
            self._command(label, key, None, action)
        return button

    def _command(self, label: str, key: Any, modifier: Any, action: Callable[[], None]) -> None:
        command = self._page.server.gui.add_command(label, hotkey=key, modifier=modifier)
        command.on_trigger(lambda _: self._page.do(action))
