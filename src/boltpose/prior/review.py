"""A person's review of a prior: edits that can be undone, kept on disk, and saved at the end."""

from __future__ import annotations

import contextlib
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import boltpose
from boltpose.errors import BoltposeError, ConfigError, InputFileError
from boltpose.io.digest import sha256_of
from boltpose.prior.edit import EditConfig
from boltpose.prior.file import read_prior, write_prior
from boltpose.prior.review_edits import (
    Edit,
    apply_edit,
    edit_from_json,
    edit_to_json,
    made_bolt,
)
from boltpose.prior.review_journal import JournalContent, ReviewJournal, reason_of
from boltpose.prior.review_notes import with_review
from boltpose.schema import Prior, PriorBolt

_SAME_PLACE_MM = 0.01
"""A head measured again on another machine may differ in the last bits, not by this."""


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    edit: Edit
    after: Prior


class ReviewSession:
    """A prior and the edits a person makes, each on disk before it is seen.

    The prior file is not touched before `save`. Use it in a `with` block, or call `close`.
    """

    def __init__(self, path: Path, prior: Prior, prior_sha256: str, journal: ReviewJournal) -> None:
        """Use `open`."""
        self.path = path
        self._base = prior
        self._base_sha256 = prior_sha256
        self._journal = journal
        self._config = EditConfig()
        self._done: list[_Step] = []
        self._undone: list[Edit] = []
        self._saved: tuple[Edit, ...] = ()
        self.resumed_edits = 0
        """Edits of an earlier review, not saved then, that were taken up."""

    @classmethod
    def open(cls, path: str | Path, *, discard: bool = False) -> Self:
        """Open a prior for review and take up what an earlier review left unsaved.

        Args:
            path: The prior.
            discard: Throw away what an earlier review left.

        Raises:
            InputFileError: The prior cannot be read; another review of it is open; or there is
                an unsaved review of another version of the file.
        """
        place = Path(path)
        prior, digest = _read_with_hash(place)
        journal = ReviewJournal(ReviewJournal.path_of(place))
        session = cls(place, prior, digest, journal)
        try:
            session._take_up(None if discard else journal.read())
        except BaseException:
            journal.close(keep=True)
            raise
        return session

    @property
    def prior(self) -> Prior:
        """As it is now, with all edits."""
        return self._done[-1].after if self._done else self._base

    @property
    def edits(self) -> tuple[Edit, ...]:
        """Those that count, in order: without what was undone."""
        return tuple(step.edit for step in self._done)

    @property
    def has_unsaved(self) -> bool:
        """Whether there are edits that no file but the journal holds."""
        return self.edits != self._saved

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to undo."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether an edit was undone, and none made since."""
        return bool(self._undone)

    def do(self, edit: Edit) -> PriorBolt | None:
        """Make an edit.

        Returns:
            The bolt it made, if it made one.

        Raises:
            ConfigError: It cannot be done; nothing has changed.
            InputFileError: It could not be written to the journal; nothing has changed.
        """
        before = self.prior
        after = apply_edit(before, edit, self._config)
        made = made_bolt(before, after)
        self._journal.append({"do": edit_to_json(edit), **_trace(made)})
        self._done.append(_Step(edit, after))
        self._undone.clear()
        return made

    def undo(self) -> Edit:
        """Take the last edit back, bit for bit.

        Raises:
            ConfigError: There is none.
            InputFileError: It could not be written to the journal; nothing has changed.
        """
        if not self._done:
            raise ConfigError("nothing to undo")
        self._journal.append({"undo": True})
        step = self._done.pop()
        self._undone.append(step.edit)
        return step.edit

    def redo(self) -> Edit:
        """Make the edit again that was undone last.

        Raises:
            ConfigError: There is none.
            InputFileError: It could not be written to the journal; nothing has changed.
        """
        if not self._undone:
            raise ConfigError("nothing to redo")
        edit = self._undone[-1]
        after = apply_edit(self.prior, edit, self._config)
        self._journal.append({"redo": True})
        self._undone.pop()
        self._done.append(_Step(edit, after))
        return edit

    def save(self, *, by: str = "", date: str = "", output: str | Path | None = None) -> Path:
        """Write the prior with its edits.

        The file appears whole or not at all. Only if it does is the journal emptied; when the
        process is killed between the two, the next review sees that the file was saved. What was
        saved into the prior itself can no longer be undone.

        Args:
            by: Who reviewed it; goes into the prior.
            date: When, in the person's words; goes into the prior only if given, so that the same
                edits of the same prior give the same bits.
            output: Where to; by default the prior is replaced.

        Returns:
            The file that was written.

        Raises:
            ConfigError: There is no edit to save, or `by` or `date` does not print.
            InputFileError: Somebody changed the prior since this review began; the target has
                unsaved edits of a review of its own; or it cannot be written. The review goes on.
        """
        if not self._done:
            raise ConfigError("nothing to save: no edit was made")
        target = self.path if output is None else Path(output)
        saved = with_review(self.prior, self.edits, base_sha256=self._base_sha256, by=by, date=date)
        is_same_file = target.resolve() == self.path.resolve()
        if is_same_file:
            self._require_unchanged()
        elif target.exists():
            require_no_review(target)
        temporary = target.resolve().with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
        try:
            write_prior(temporary, saved)
            digest = sha256_of(temporary)
            if is_same_file:
                self._journal.append({"saving": digest})
                self._require_unchanged()
            temporary.replace(target.resolve())
        except OSError as error:
            raise InputFileError(
                target,
                f"that it cannot be written ({reason_of(error)})",
                "a folder to write to, with room; the edits are kept",
            ) from error
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        if is_same_file:
            self._base, self._base_sha256 = saved, digest
            self._done.clear()
            self._undone.clear()
            self._journal.start(digest, boltpose.__version__)
        else:
            # the prior is as it was: all edits go into the next file too
            self._journal.append({"saved_as": digest})
        self._saved = self.edits
        return target

    def close(self) -> None:
        """End the review; unsaved edits stay in the journal. Safe to call twice."""
        self._journal.close(keep=self.has_unsaved or (self.can_redo and not self._saved))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _require_unchanged(self) -> None:
        if not self.path.exists() or sha256_of(self.path) != self._base_sha256:
            raise InputFileError(
                self.path,
                "another content than when this review began",
                "the file as it was: put it back and save again, or end and begin anew with "
                "--discard",
            )

    def _take_up(self, content: JournalContent | None) -> None:
        last = content.acts[-1] if content is not None and content.acts else {}
        is_saved = "saved_as" in last or last.get("saving") == self._base_sha256
        if content is None or is_saved:
            self._journal.start(self._base_sha256, boltpose.__version__)
            return
        if content.prior_sha256 != self._base_sha256:
            if not content.acts:
                self._journal.start(self._base_sha256, boltpose.__version__)
                return
            raise InputFileError(
                self._journal.path,
                f"{len(content.acts)} unsaved acts on another version of {self.path.name}",
                "the version they were made on, or --discard to throw them away",
            )
        for number, act in enumerate(content.acts, start=1):
            try:
                self._replay(act)
            except (BoltposeError, IndexError, TypeError, ValueError) as error:
                raise InputFileError(
                    self._journal.path,
                    f"act {number}, by version {content.version}, that cannot be done again "
                    f"({error})",
                    "--discard to throw the unsaved acts away",
                ) from error
        self._journal.resume(content)
        self.resumed_edits = len(self._done)

    def _replay(self, act: Mapping[str, Any]) -> None:
        if "do" in act:
            before, edit = self.prior, edit_from_json(act["do"])
            after = apply_edit(before, edit, self._config)
            _require_same(act.get("made"), made_bolt(before, after))
            self._done.append(_Step(edit, after))
            self._undone.clear()
        elif "undo" in act:
            self._undone.append(self._done.pop().edit)
        elif "redo" in act:
            edit = self._undone.pop()
            self._done.append(_Step(edit, apply_edit(self.prior, edit, self._config)))
        elif "saving" not in act and "saved_as" not in act:  # neither changes what is shown
            raise ConfigError(f"no act: {sorted(act)}")


def require_no_review(path: str | Path) -> None:
    """Refuse to replace a prior while a review of it is open or unsaved: its edits would be lost.

    Raises:
        InputFileError: There is one.
    """
    place = ReviewJournal.path_of(path)
    if not place.exists():
        return
    journal = ReviewJournal(place)
    try:
        content = journal.read()
    finally:
        journal.close(keep=True)
    last = content.acts[-1] if content is not None and content.acts else {"saved_as": ""}
    if "saved_as" not in last and last.get("saving") != sha256_of(path):
        raise InputFileError(
            place,
            "edits of a review that were not saved",
            "them saved by `boltpose prior review`, or thrown away by its --discard",
        )


def review_order(prior: Prior) -> tuple[PriorBolt, ...]:
    """The bolts as a person should go through them: unsure ones first, most doubtful first."""
    unsure = sorted((b for b in prior.bolts if not b.is_sure), key=lambda b: b.confidence)
    return (*unsure, *(bolt for bolt in prior.bolts if bolt.is_sure))


def _read_with_hash(path: Path) -> tuple[Prior, str]:
    """The prior and the hash of the very bytes it was read from."""
    while True:
        prior_before = sha256_of(path) if path.is_file() else ""
        prior = read_prior(path)
        if sha256_of(path) == prior_before:
            return prior, prior_before


def _trace(made: PriorBolt | None) -> dict[str, Any]:
    if made is None:
        return {}
    head_top = [round(float(value), 4) for value in made.prior_from_bolt.translation_mm]
    return {"made": {"id": made.id, "head_top_mm": head_top}}


def _require_same(noted: Any, made: PriorBolt | None) -> None:
    """A bolt made again must be the one the person saw."""
    if noted is None and made is None:
        return
    is_same = (
        made is not None
        and isinstance(noted, dict)
        and noted.get("id") == made.id
        and all(
            abs(float(was) - float(now)) < _SAME_PLACE_MM
            for was, now in zip(
                noted.get("head_top_mm", []),
                made.prior_from_bolt.translation_mm,
                strict=True,
            )
        )
    )
    if not is_same:
        raise ConfigError("its head is now measured elsewhere")
