"""What a person did to a prior, one record per act: it can be written down and done again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from boltpose.errors import ConfigError
from boltpose.prior.edit import EditConfig, add_bolt, confirm_bolt, flip_bolt, remove_bolt
from boltpose.prior.review_words import name_bolt, set_orders, set_tool
from boltpose.schema import Prior, PriorBolt


@dataclass(frozen=True, slots=True, kw_only=True)
class AddBolt:
    """A click on the head of a bolt that was missed."""

    position_mm: tuple[float, float, float]
    """Frame `prior`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoveBolt:
    """What was found is no bolt."""

    bolt: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfirmBolt:
    """An unsure bolt was found right."""

    bolt: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FlipBolt:
    """The head looks the other way."""

    bolt: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NameBolt:
    """What people call it; empty takes the name away."""

    bolt: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTool:
    """The tool that turns one or several bolts; empty takes it away."""

    bolts: tuple[str, ...]
    tool: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SetOrders:
    """The turn of one or several bolts; None takes it away."""

    orders: tuple[tuple[str, int | None], ...]


Edit = AddBolt | RemoveBolt | ConfirmBolt | FlipBolt | NameBolt | SetTool | SetOrders


def apply_edit(prior: Prior, edit: Edit, config: EditConfig | None = None) -> Prior:
    """Do one edit; the same edit of the same prior gives the same bits.

    Raises:
        ConfigError: It cannot be done to this prior.
    """
    match edit:
        case AddBolt():
            return add_bolt(prior, edit.position_mm, config)
        case RemoveBolt():
            return remove_bolt(prior, edit.bolt)
        case ConfirmBolt():
            return confirm_bolt(prior, edit.bolt)
        case FlipBolt():
            return flip_bolt(prior, edit.bolt, config)
        case NameBolt():
            return name_bolt(prior, edit.bolt, edit.name)
        case SetTool():
            return set_tool(prior, edit.bolts, edit.tool)
        case SetOrders():
            return set_orders(prior, dict(edit.orders))


def made_bolt(before: Prior, after: Prior) -> PriorBolt | None:
    """The bolt that an edit made (added, or flipped to the other side); None if it made none."""
    known = {bolt.id for bolt in before.bolts}
    return next((bolt for bolt in after.bolts if bolt.id not in known), None)


def edit_to_json(edit: Edit) -> dict[str, Any]:
    """An edit, JSON-ready; `edit` says of which kind it is."""
    match edit:
        case AddBolt():
            return {"edit": "add", "position_mm": list(edit.position_mm)}
        case RemoveBolt():
            return {"edit": "remove", "bolt": edit.bolt}
        case ConfirmBolt():
            return {"edit": "confirm", "bolt": edit.bolt}
        case FlipBolt():
            return {"edit": "flip", "bolt": edit.bolt}
        case NameBolt():
            return {"edit": "name", "bolt": edit.bolt, "name": edit.name}
        case SetTool():
            return {"edit": "tool", "bolts": list(edit.bolts), "tool": edit.tool}
        case SetOrders():
            return {"edit": "order", "orders": dict(edit.orders)}


def edit_from_json(data: object) -> Edit:
    """Read what `edit_to_json` wrote.

    Raises:
        ConfigError: It is no edit.
    """
    try:
        return _read(cast("Mapping[str, Any]", data))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"no edit of a prior: {data!r}") from error


def _read(data: Mapping[str, Any]) -> Edit:
    match data["edit"]:
        case "add":
            return AddBolt(position_mm=as_position(data["position_mm"]))
        case "remove":
            return RemoveBolt(bolt=_text(data["bolt"]))
        case "confirm":
            return ConfirmBolt(bolt=_text(data["bolt"]))
        case "flip":
            return FlipBolt(bolt=_text(data["bolt"]))
        case "name":
            return NameBolt(bolt=_text(data["bolt"]), name=_text(data["name"]))
        case "tool":
            bolts = tuple(_text(bolt) for bolt in _list(data["bolts"]))
            return SetTool(bolts=bolts, tool=_text(data["tool"]))
        case "order":
            orders = cast("Mapping[str, Any]", data["orders"])
            return SetOrders(orders=tuple((_text(k), _turn(v)) for k, v in orders.items()))
        case _:
            raise ValueError(data["edit"])


def as_position(values: Sequence[Any]) -> tuple[float, float, float]:
    """Three finite numbers as a position, mm.

    Raises:
        ValueError: They are not.
    """
    x, y, z = (float(value) for value in values)
    if not all(math.isfinite(value) for value in (x, y, z)):
        raise ValueError(values)
    return x, y, z


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def _list(value: object) -> list[object]:
    if not isinstance(value, list):
        raise TypeError(value)
    return cast("list[object]", value)


def _turn(value: object) -> int | None:
    if value is not None and type(value) is not int:
        raise TypeError(value)
    return value
