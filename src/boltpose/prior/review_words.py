"""What people say about a bolt of a prior: its name, its tool, its turn."""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Mapping
from dataclasses import replace

from boltpose.errors import ConfigError
from boltpose.prior.edit import change_bolt, require_bolt
from boltpose.schema import Prior

MAX_WORDS = 60
"""Characters of a name or a tool: it must fit into a row of a table and a robot's comment."""
MAX_ORDER = 999


def name_bolt(prior: Prior, bolt_id: str, name: str) -> Prior:
    """Say what people call a bolt; an empty name takes the name away.

    Args:
        prior: The prior.
        bolt_id: The bolt.
        name: One line; spaces at its ends are dropped.

    Raises:
        ConfigError: No such bolt; the name is too long, holds control characters, or another bolt
            is called so, or has it for an id. Upper and lower case count as the same.
    """
    require_bolt(prior, bolt_id)
    wanted = clean_words(name, "a name")
    for other in prior.bolts:
        if not wanted or other.id == bolt_id:
            continue
        if _same(other.id, wanted):
            raise ConfigError(f"'{wanted}' is the id of another bolt, wanted another name")
        if _same(other.name, wanted):
            raise ConfigError(f"bolt {other.id} is already called '{other.name}', wanted another")
    return change_bolt(prior, bolt_id, lambda bolt: replace(bolt, name=wanted))


def set_tool(prior: Prior, bolt_ids: Collection[str], tool: str) -> Prior:
    """Say which tool turns some bolts, in the cell's own words; empty takes it away.

    Raises:
        ConfigError: No such bolt, or the words are too long or hold control characters.
    """
    wanted = clean_words(tool, "a tool")
    for bolt_id in bolt_ids:
        prior = change_bolt(prior, bolt_id, lambda bolt: replace(bolt, tool=wanted))
    return prior


def set_orders(prior: Prior, orders: Mapping[str, int | None]) -> Prior:
    """Say in which turn bolts are taken out, for several bolts at once.

    Args:
        prior: The prior.
        orders: Turn by bolt, from 1; None takes the turn away. Bolts that are not named keep
            theirs. Two bolts can so change places.

    Raises:
        ConfigError: No such bolt, a turn is no number from 1 to 999, or two bolts would have the
            same turn.
    """
    for bolt_id, order in orders.items():
        require_bolt(prior, bolt_id)
        # True is an int in Python, and no turn
        if order is not None and (type(order) is not int or not 1 <= order <= MAX_ORDER):
            raise ConfigError(f"the turn of {bolt_id} must be 1 to {MAX_ORDER}, got {order!r}")
    bolts = tuple(
        replace(bolt, order=orders[bolt.id]) if bolt.id in orders else bolt for bolt in prior.bolts
    )
    holders: dict[int, str] = {}
    for bolt in bolts:
        if bolt.order is None:
            continue
        first = holders.setdefault(bolt.order, bolt.id)
        if first != bolt.id:
            raise ConfigError(f"{first} and {bolt.id} would both have turn {bolt.order}")
    return replace(prior, bolts=bolts)


def set_order(prior: Prior, bolt_id: str, order: int | None) -> Prior:
    """Say in which turn one bolt is taken out; see `set_orders`.

    Raises:
        ConfigError: As `set_orders`.
    """
    return set_orders(prior, {bolt_id: order})


def clean_words(text: str, what: str) -> str:
    """Bring a person's words into one form: composed characters, single spaces, no ends.

    Args:
        text: The words.
        what: For the message, for example `a name`.

    Raises:
        ConfigError: They hold characters that do not print, or are too long.
    """
    composed = unicodedata.normalize("NFC", text)
    # C: control, direction marks, unassigned; a blank other than the space would not be seen
    bad = [c for c in composed if unicodedata.category(c) in _UNPRINTABLE]
    if bad:
        raise ConfigError(f"{what} must hold printable characters only, got {bad[0]!r} in it")
    words = " ".join(composed.split())
    if len(words) > MAX_WORDS:
        raise ConfigError(f"{what} must have at most {MAX_WORDS} characters, got {len(words)}")
    return words


_UNPRINTABLE = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})


def _same(first: str, second: str) -> bool:
    return first.casefold() == second.casefold()
