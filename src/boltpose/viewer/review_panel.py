"""The widgets of the review: what a person presses and types. They know no prior."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from boltpose.viewer.page import Page
from boltpose.viewer.web import viser

NOTHING: str = "no bolt"
"""What the list of bolts offers where there is none."""
_FLIP = "Other side  [F]"
_NEXT = "Next  [N]"
_SET = "Set"
_NEXT_TURN = "Next free turn"
_SAME_TOOL = "Tool for this size"
_REDO = "Redo"
_WHOLE = "Whole motor"
_END = "End"


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

    def set_words_of(self, bolt_id: str) -> None:
        """Take over what was typed for a bolt that is no longer at hand."""

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


@dataclass(slots=True, eq=False)
class _Fields:
    form: viser.GuiFormHandle
    name: viser.GuiInputHandle[str]
    tool: viser.GuiInputHandle[str]
    turn: viser.GuiInputHandle[str]
    shown: Words = Words(name="", tool="", turn="")

    @property
    def words(self) -> Words:
        return Words(name=self.name.value, tool=self.tool.value, turn=self.turn.value)

    def show(self, words: Words) -> None:
        self.shown = words
        self.name.value, self.tool.value, self.turn.value = words.name, words.tool, words.turn


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
        self._actions = actions
        self._ids: Mapping[str, str] = {}
        self._fields: dict[str, _Fields] = {}
        self._chosen: str | None = None
        gui = page.server.gui
        self._tab = page.tab("Review")
        with self._tab:
            self.card = gui.add_html("")
            self._confirm = self._button("Confirm: this is right", "C", "green", actions.confirm)
            self._remove = self._button("Remove: no bolt", "X", "red", actions.remove)
            steps = gui.add_button_group("", (_FLIP, _NEXT))
            self._anchor = gui.add_html("")
            words = gui.add_button_group("", (_SET, _NEXT_TURN, _SAME_TOOL))
            self.add = self._button("", "B", "blue", actions.toggle_adding)
            self._undo = self._button("Undo", None, "gray", actions.undo)
            self._by = gui.add_text("Your name", by, hint="Goes into the prior.")
            self._save = self._button("Save", None, "green", actions.save)
            others = gui.add_button_group("", (_REDO, _WHOLE, _END))
            self.table = gui.add_html("")
            self._list: viser.GuiDropdownHandle[str] = gui.add_dropdown("Bolt", (NOTHING,))
        self._list.on_update(lambda event: self._picked(event, actions))
        self._group(steps, {_FLIP: actions.flip, _NEXT: actions.go_on})
        self._group(
            words,
            {
                _SET: actions.set_words,
                _NEXT_TURN: actions.take_next_turn,
                _SAME_TOOL: actions.spread_tool,
            },
        )
        self._group(others, {_REDO: actions.redo, _WHOLE: actions.show_all, _END: actions.end})
        self._command("Turn to the other side", "F", None, actions.flip)
        self._command("Next", "N", None, actions.go_on)
        self._command("Undo", "Z", "cmd/ctrl", actions.undo)
        self._command("Redo", "Y", "cmd/ctrl", actions.redo)

    @property
    def by(self) -> str:
        """Who the person says to be."""
        return self._by.value

    def typed(self, bolt_id: str) -> Words | None:
        """What was typed for a bolt and not yet set; None if nothing was."""
        fields = self._fields.get(bolt_id)
        return None if fields is None or fields.words == fields.shown else fields.words

    def show_words(self, bolt_id: str | None, words: Words) -> None:
        """Show the fields of one bolt; what was typed there stays if its words are as they were.

        Every bolt has fields of its own: the browser sends what is typed a little late, and a
        name must never become that of the bolt that was chosen next.
        """
        if self._chosen != bolt_id:
            for key, fields in self._fields.items():
                fields.form.visible = key == bolt_id
            self._chosen = bolt_id
        if bolt_id is None:
            return
        if bolt_id not in self._fields:
            self._fields[bolt_id] = self._make_fields(bolt_id)
        fields = self._fields[bolt_id]
        if fields.shown != words:
            fields.show(words)

    def settle(self, bolt_id: str, words: Words) -> None:
        """What was typed for a bolt has been set."""
        if bolt_id in self._fields:
            self._fields[bolt_id].show(words)

    def forget_all_but(self, bolt_ids: Collection[str]) -> None:
        """Drop the fields of bolts that are no more: another may get their id."""
        for bolt_id in [key for key in self._fields if key not in bolt_ids]:
            self._fields.pop(bolt_id).form.remove()

    def _make_fields(self, bolt_id: str) -> _Fields:
        gui, page, actions = self._page.server.gui, self._page, self._actions
        with self._tab, gui.add_form(None, order=self._anchor.order) as form:
            fields = _Fields(
                form=form,
                name=gui.add_text("Name", "", hint="What people call it; Enter sets it."),
                tool=gui.add_text("Tool", "", hint="In your own words, such as hex 8."),
                turn=gui.add_text("Turn", "", hint="1 is taken out first; empty: none."),
            )

        def changed(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None and self._chosen != bolt_id:
                page.do(actions.set_words_of, bolt_id)  # it came after the bolt was left

        for field in (fields.name, fields.tool, fields.turn):
            field.on_update(changed)
        form.on_submit(lambda _: page.do(actions.set_words))
        return fields

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
        self.add.label = "Stop adding  [B]" if is_adding else "Add a missed bolt  [B]"

    def enable(self, *, has_bolt: bool, can_confirm: bool, undo: str | None, save: bool) -> None:
        """Let only those buttons be pressed that can do something.

        Args:
            has_bolt: A bolt is chosen.
            can_confirm: It is unsure.
            undo: What would be undone; None for nothing.
            save: Something can be saved.
        """
        self._confirm.disabled = not can_confirm
        self._remove.disabled = not has_bolt
        self._undo.label = "Undo" if undo is None else f"Undo: {undo}"
        self._undo.disabled = undo is None
        self._save.disabled = not save

    def _picked(self, event: viser.GuiEvent[Any], actions: ReviewActions) -> None:
        bolt_id = self._ids.get(self._list.value)
        if event.client_id is not None and bolt_id:  # else it was us who changed the list
            self._page.do(actions.choose, bolt_id)

    def _group(
        self, group: viser.GuiButtonGroupHandle, actions: Mapping[str, Callable[[], None]]
    ) -> None:
        group.on_click(lambda event: self._page.do(actions[event.target.value]))

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
