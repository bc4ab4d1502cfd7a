"""HTML that cannot be broken by what is written into it: whatever is not `Html` is escaped."""

from __future__ import annotations

import base64
import html
import math
import unicodedata
from collections.abc import Iterable


class Html(str):
    """Text that is HTML already; only this module makes it, from parts it has escaped."""

    __slots__ = ()


_VOID = frozenset({"meta", "br", "image", "rect", "line", "circle", "path", "polygon", "polyline"})
_HIDDEN_KINDS = frozenset({"Cc", "Cf", "Cs", "Co", "Cn"})
"""Control, format (turns the direction of writing), half characters, unknown: they only mislead."""
_UNREADABLE = "\N{REPLACEMENT CHARACTER}"


def escape(text: object) -> Html:
    """Make any text harmless in an element or a quoted attribute.

    Characters that no one can see, but that change how a line reads, become a visible sign.
    """
    if isinstance(text, Html):
        return text
    plain = str(text)
    if plain.isascii() and plain.isprintable():
        return Html(html.escape(plain, quote=True))
    kept = (
        " "
        if sign in "\n\r\t"
        else _UNREADABLE
        if unicodedata.category(sign) in _HIDDEN_KINDS
        else sign
        for sign in plain
    )
    return Html(html.escape("".join(kept), quote=True))


def tag(name: str, /, *children: object, **attributes: object) -> Html:
    """Build one element.

    Args:
        name: Of the element.
        children: Text, which is escaped, or `Html`, which is not; None is nothing.
        attributes: Their values are escaped. `class_` is `class`, other underscores are hyphens;
            None leaves the attribute out.

    Returns:
        The element with its children.
    """
    shown = "".join(
        f' {_attribute_name(key)}="{escape(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in _VOID:
        return Html(f"<{name}{shown}>" if name in ("meta", "br") else f"<{name}{shown}/>")
    return Html(f"<{name}{shown}>{join(children)}</{name}>")


def data_uri(data: bytes, media_type: str) -> Html:
    """Bytes as an address that holds them; of an alphabet in which nothing needs escaping."""
    return Html(f"data:{escape(media_type)};base64,{base64.b64encode(data).decode('ascii')}")


def join(parts: Iterable[object], between: str = "") -> Html:
    """Put parts behind each other, escaped as in `tag`; None is left out."""
    return Html(escape(between).join(escape(part) for part in parts if part is not None))


def number(value: float, digits: int) -> str:
    """Write a number with a fixed number of decimals; a true minus sign, and never `-0.00`."""
    if not math.isfinite(value):
        return "not finite"
    text = f"{value:.{digits}f}"
    if float(text) == 0:
        text = text.removeprefix("-")
    return text.replace("-", "\N{MINUS SIGN}")


def percent(share: float) -> str:
    """Write a share in percent, rounded down: 100 % is said of nothing less."""
    if not math.isfinite(share):
        return "not finite"
    return f"{math.floor(100 * share + 1e-9)}\N{NO-BREAK SPACE}%"


def clip(text: str, length: int) -> str:
    """Cut a text that is longer than a cell can hold; an ellipsis shows it."""
    return text if len(text) <= length else f"{text[: length - 1]}\N{HORIZONTAL ELLIPSIS}"


def _attribute_name(key: str) -> str:
    name = key.rstrip("_")
    # SVG's own names are written as they are
    return name if name in ("viewBox", "preserveAspectRatio") else name.replace("_", "-")
