"""Pieces of a self-contained HTML page; every text is escaped."""

from __future__ import annotations

import gzip
import hashlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Final

from dicedesign.results.result import StageTime

__all__ = [
    "LinkedRow",
    "PageScript",
    "figure_section",
    "list_section",
    "number",
    "page",
    "stages_section",
    "table_section",
    "text_section",
]

_STYLE: Final = """
:root { color-scheme: light; }
body { margin: 0 auto; padding: 1rem; max-width: 60rem; background: #fff; color: #1f2933;
  font: 16px/1.5 system-ui, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: .5rem 0 .25rem; }
h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; padding-top: .75rem; border-top: 1px solid #d9e0e7; }
p { margin: .5rem 0; }
.verdict { font-size: 1.05rem; padding: .6rem .8rem; background: #f3f5f7;
  border-left: 4px solid #c2571a; }
.note { color: #52606d; font-size: .9rem; }
img { display: block; width: 100%; min-width: 36rem; height: auto; }
img.moving { width: auto; min-width: 0; margin: 0 auto; }
ul { margin: .5rem 0; padding-left: 1.25rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .75rem; border-bottom: 1px solid #e4e9ee; text-align: right;
  overflow-wrap: normal; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
"""

_POLICY: Final = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; "
    "style-src 'unsafe-inline'"
)
"""A page loads nothing and runs no script but its own, whatever a name or a label in it says."""

_PACKING: Final = 6
"""Level of gzip; higher ones gain next to nothing."""

_PEAK_SINCE: Final = {
    "stage": "during the stage",
    "start": "from its start to the end of the stage",
}


@dataclass(frozen=True)
class PageScript:
    """What a page runs.

    Attributes
    ----------
    text: the script, of ASCII characters.
    style: rules of CSS for what it shows.
    data: content by the id of an element that holds it, packed by gzip, in base64.
    inserted: scripts of the data that it runs.
    """

    text: str
    style: str = ""
    data: Mapping[str, bytes] = field(default_factory=dict)
    inserted: Sequence[str] = ()

    @property
    def policy(self) -> str:
        """The part of a page's policy that allows these scripts and no others."""
        texts = (self.text, *self.inserted)
        sums = [b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts]
        return "; script-src " + " ".join(f"'sha256-{found}'" for found in sums)

    @property
    def elements(self) -> str:
        """The data and the script, as a page has them at its end."""
        blocks = [
            f'<script type="application/gzip" id="{escape(name)}">'
            f"{b64encode(gzip.compress(content, _PACKING, mtime=0)).decode('ascii')}</script>"
            for name, content in self.data.items()
        ]
        return "\n".join([*blocks, f"<script>{self.text}</script>"])


@dataclass(frozen=True)
class LinkedRow:
    """Marks of a row of a table by which a script finds it.

    Attributes
    ----------
    data: attributes by name, without "data-".
    color: "#rrggbb" of a square at its beginning.
    """

    data: Mapping[str, str]
    color: str


def number(value: float | None, digits: int) -> str:
    """A number with a count of significant digits, or "-" where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


def figure_section(title: str, image: bytes, caption: str, overlay: str = "") -> str:
    """A section with a picture and a line below it.

    image: a PNG, as wide as the page, or a GIF, in its own size; overlay: an element of SVG that
        covers it.
    """
    data = b64encode(image).decode("ascii")
    moving = image.startswith(b"GIF8")
    kind, look = ("gif", ' class="moving"') if moving else ("png", "")
    picture = f'<img{look} alt="{escape(title)}" src="data:image/{kind};base64,{data}">'
    if overlay:
        picture = f'<div class="covered">{picture}{overlay}</div>'
    return (
        f"<section><h2>{escape(title)}</h2>"
        f'<div class="scroll">{picture}</div>'
        f'<p class="note">{escape(caption)}</p></section>'
    )


def text_section(title: str, paragraphs: Sequence[str]) -> str:
    """A section with paragraphs of text."""
    body = "".join(f"<p>{escape(paragraph)}</p>" for paragraph in paragraphs)
    return f"<section><h2>{escape(title)}</h2>{body}</section>"


def list_section(title: str, items: Sequence[str]) -> str:
    """A section with a list of texts."""
    entries = "".join(f"<li>{escape(item)}</li>" for item in items)
    return f"<section><h2>{escape(title)}</h2><ul>{entries}</ul></section>"


def table_section(
    title: str,
    header: Sequence[str],
    rows: Sequence[Sequence[Any]],
    note: str = "",
    links: Sequence[LinkedRow] = (),
) -> str:
    """A section with a table; the first column is aligned to the left.

    links: one for each row, or none at all.
    """
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    opened = [("<tr>", "")] * len(rows) if not links else [_linked(link) for link in links]
    body = "".join(
        f"{tag}<td>{mark}" + "</td><td>".join(escape(str(cell)) for cell in row) + "</td></tr>"
        for (tag, mark), row in zip(opened, rows, strict=True)
    )
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    return (
        f'<section><h2>{escape(title)}</h2><div class="scroll"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{below}</section>"
    )


def _linked(link: LinkedRow) -> tuple[str, str]:
    """How a row begins, and its square."""
    data = "".join(f' data-{name}="{escape(text)}"' for name, text in link.data.items())
    return f'<tr tabindex="0"{data}>', f'<i style="background:{link.color}"></i>'


def stages_section(stages: Sequence[StageTime], peak_since: str) -> str:
    """A table of stages; peak_since: "stage" or "start", what their memory counts from."""
    rows = [[stage.name, f"{stage.seconds:.2f}", number(stage.peak_mb, 4)] for stage in stages]
    memory = (
        "Only what the recipe asks for is run; the making of this page follows. Memory is the most "
        f"that the whole program held {_PEAK_SINCE[peak_since]}, libraries included."
    )
    return table_section("Stages", ["stage", "time (s)", "memory (MB)"], rows, memory)


def page(title: str, parts: Sequence[str], script: PageScript | None = None) -> str:
    """A whole document that opens offline."""
    policy, style, end = _POLICY, _STYLE, ""
    if script is not None:
        policy, style, end = policy + script.policy, style + script.style, script.elements + "\n"
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style></head><body>\n"
        + "\n".join(parts)
        + f"\n{end}</body></html>\n"
    )
