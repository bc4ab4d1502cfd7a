"""What a prior says of its reviews: who changed what, on which version of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import boltpose
from boltpose.prior.review_edits import Edit, edit_to_json
from boltpose.prior.review_words import clean_words
from boltpose.schema import Prior


@dataclass(frozen=True, slots=True, kw_only=True)
class PastReview:
    """What a prior says of one review of it."""

    by: str
    """Empty if nobody said."""
    date: str
    """In the person's words; empty if not given."""
    edit_count: int


def past_reviews(prior: Prior) -> tuple[PastReview, ...]:
    """The reviews that a prior went through, the first one first; none where it says nothing."""
    entries = prior.provenance.get("reviews")
    if not isinstance(entries, list):
        return ()
    return tuple(_past(entry) for entry in cast("list[object]", entries))


def with_review(
    prior: Prior, edits: Sequence[Edit], *, base_sha256: str, by: str = "", date: str = ""
) -> Prior:
    """Note in a prior's provenance who did what to which version of it.

    Args:
        prior: With the edits done.
        edits: Those that were done.
        base_sha256: Of the prior file they were done to.
        by: Who; left out if empty.
        date: When; left out if empty.

    Raises:
        ConfigError: `by` or `date` is too long or does not print.
    """
    entry: dict[str, Any] = {
        "prior_sha256": base_sha256,
        "version": boltpose.__version__,
        "edits": [edit_to_json(edit) for edit in edits],
    }
    for key, words in (("by", clean_words(by, "--by")), ("date", clean_words(date, "--date"))):
        if words:
            entry[key] = words
    earlier = prior.provenance.get("reviews", [])
    return replace(prior, provenance={**prior.provenance, "reviews": [*earlier, entry]})


def _past(entry: object) -> PastReview:
    said = cast("Mapping[str, object]", entry) if isinstance(entry, Mapping) else {}
    edits = said.get("edits")
    return PastReview(
        by=str(said.get("by", "")),
        date=str(said.get("date", "")),
        edit_count=len(cast("list[object]", edits)) if isinstance(edits, list) else 0,
    )
