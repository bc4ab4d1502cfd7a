"""Signs that tell the same as the colours: drawn, so that no font has to have them."""

from __future__ import annotations

from boltpose.report.markup import Html, tag
from boltpose.schema import Visibility


def verdict_icon(*, is_ok: bool) -> Html:
    """A tick in a disc, or a cross in a stop sign."""
    if is_ok:
        return _icon(
            tag("circle", cx=12, cy=12, r=11, fill="#fff"),
            tag("path", d="M6 12.5l4.2 4.3L18.4 8", fill="none", **_stroke("#14692f", 3)),
        )
    return _icon(
        tag("polygon", points="7,1 17,1 23,7 23,17 17,23 7,23 1,17 1,7", fill="#fff"),
        tag("path", d="M7.5 7.5l9 9m0-9l-9 9", **_stroke("#a80019", 3.2)),
    )


def warning_icon() -> Html:
    """A triangle with an exclamation mark."""
    return _icon(
        tag("polygon", points="12,2 23,21.5 1,21.5", fill="#ffd400", **_stroke("#111", 1.8)),
        tag("path", d="M12 8.5v6", **_stroke("#111", 2.4)),
        tag("circle", cx=12, cy=18, r=1.4, fill="#111"),
    )


def cross_icon() -> Html:
    """A bold cross: not this one."""
    return _icon(tag("path", d="M4 4l16 16m0-16L4 20", **_stroke("#a80019", 5)))


def visibility_icon(visibility: Visibility) -> Html:
    """A full, a half full or an empty dashed ring."""
    dashes = "4 3" if visibility is Visibility.HIDDEN else None
    ring = tag("circle", cx=12, cy=12, r=9, fill="none", stroke_dasharray=dashes, **_stroke("#111"))
    if visibility is Visibility.VISIBLE:
        return _icon(ring, tag("circle", cx=12, cy=12, r=9, fill="#111"))
    if visibility is Visibility.PARTIAL:
        return _icon(ring, tag("path", d="M12 3a9 9 0 0 0 0 18z", fill="#111"))
    return _icon(ring)


def _icon(*shapes: Html) -> Html:
    return tag("svg", *shapes, class_="icon", viewBox="0 0 24 24", aria_hidden="true")


def _stroke(color: str, width: float = 2.5) -> dict[str, object]:
    return {"stroke": color, "stroke_width": width}
