"""A stored request computed again: does the same input still give the same poses?"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from boltpose.service.calls import LocateCall
from boltpose.service.execute import Executor
from boltpose.service.failures import ServiceError
from boltpose.service.journal import Entry, State

_MOST_DIFFERENCES = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """What came of it."""

    id: str
    differences: tuple[str, ...]
    """Where the two results differ, timings apart; empty if they are the same."""
    poses: str
    """The text of the new `poses.json`; empty where the request failed again as it had."""

    @property
    def is_same(self) -> bool:
        """Whether the answer was the same."""
        return not self.differences


def replay(entry: Entry, executor: Executor) -> Replay:
    """Compute a request of the journal again.

    Args:
        entry: A `locate` request with a result, or one that failed because of its input.
        executor: Of the data folder the entry is from.

    Raises:
        ServiceError: There is nothing to compare with, or the input is not kept any more.
    """
    has_failed = entry.state is State.FAILED and entry.error_code is not None
    if entry.kind != "locate" or (entry.result is None and not has_failed):
        raise ServiceError(409, "no_result", f"{entry.id}: {entry.state} {entry.kind}, no result")
    if not entry.has_inputs:
        raise ServiceError(404, "inputs_deleted", f"{entry.id}: its input is not kept any more")
    try:
        text = executor.locate(LocateCall.from_json(entry.call))
    except ServiceError as error:
        if entry.result is None and error.code == entry.error_code:
            return Replay(id=entry.id, differences=(), poses="")
        found = f"now fails: {error}"
        return Replay(id=entry.id, differences=(found,), poses="")
    if entry.result is None:
        return Replay(id=entry.id, differences=(f"had failed: {entry.error}",), poses=text)
    old, new = json.loads(entry.result), json.loads(text)
    for data in (old, new):
        data.pop("timings_ms", None)
    differences = _compare("", old, new)
    return Replay(id=entry.id, differences=tuple(differences[:_MOST_DIFFERENCES]), poses=text)


def _compare(where: str, old: Any, new: Any) -> list[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        return [
            line
            for key in sorted({*old, *new})
            for line in _compare(f"{where}.{key}".lstrip("."), old.get(key), new.get(key))
        ]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [
            line
            for row, (before, after) in enumerate(zip(old, new, strict=True))
            for line in _compare(f"{where}[{row}]", before, after)
        ]
    if type(old) is type(new) and old == new:
        return []
    return [f"{where}: was {_short(old)}, is {_short(new)}"]


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
