"""Pages are taken apart here as a browser would do it; pictures are drawn coarsely."""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser

import pytest

from boltpose.report.markup import Html

VOID = {"meta", "br"}


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("boltpose.report.pictures._DOTS_PER_PX", 1)


@dataclass
class Element:
    """One element of a page."""

    name: str
    attributes: dict[str, str | None]
    texts: list[str] = field(default_factory=list)
    """Of the element and all in it."""
    children: list[Element] = field(default_factory=list)

    @property
    def text(self) -> str:
        return " ".join("".join(self.texts).split())

    def all(self, name: str | None = None, class_: str | None = None) -> list[Element]:
        found = []
        for child in self.children:
            classes = (child.attributes.get("class") or "").split()
            if name in (None, child.name) and (class_ is None or class_ in classes):
                found.append(child)
            found += child.all(name, class_)
        return found


class _Parser(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.root = Element("document", {})
        self._open = [self.root]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, dict(attrs))
        self._open[-1].children.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open[-1].children.append(Element(tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open[-1].name == tag, f"</{tag}> closes <{self._open[-1].name}>"
        self._open.pop()

    def handle_data(self, data: str) -> None:
        for element in self._open:
            element.texts.append(data)


def parse(page: str | Html) -> Element:
    """Take HTML apart; elements that are not closed in order are an error."""
    parser = _Parser()
    parser.feed(page)
    parser.close()
    assert len(parser._open) == 1, f"<{parser._open[-1].name}> is not closed"
    return parser.root
