"""Parse HTML pages."""

from __future__ import annotations

from base64 import b64decode
from gzip import decompress
from html.parser import HTMLParser

VOID = {"meta", "img", "br"}


class Checker(HTMLParser):
    """Check that tags are closed in order; collect elements, visible text, cells, image sources and
    the contents of scripts with an id."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.cells: list[str] = []
        self.text = ""
        self.packed: dict[str, str] = {}

    @property
    def sources(self) -> list[str]:
        return [attributes["src"] for attributes in self.tagged("img")]

    def tagged(self, tag: str) -> list[dict[str, str]]:
        """Attributes of each element with a tag."""
        return [attributes for name, attributes in self.elements if name == tag]

    def facets(self, tag: str) -> list[str]:
        """Facets of the elements with a tag that have one."""
        return [a["data-facet"] for a in self.tagged(tag) if "data-facet" in a]

    def unpack(self, name: str) -> bytes:
        """Content of the data with an id."""
        return decompress(b64decode(self.packed[name]))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        tag = self.open[-1] if self.open else ""
        if tag == "script":
            name = self.elements[-1][1].get("id", "")
            self.packed[name] = self.packed.get(name, "") + data
        elif tag != "style":
            self.text += data
        if tag == "td":
            self.cells.append(data)


def parse_page(text: str) -> Checker:
    checker = Checker()
    checker.feed(text)
    checker.close()
    assert checker.open == []
    return checker
