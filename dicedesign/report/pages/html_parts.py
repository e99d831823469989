"""Pieces of a self-contained HTML page; every text is escaped."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from typing import Any, Final

from dicedesign.results.record import StageTime

__all__ = [
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

_POLICY: Final = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""A page runs no script and loads nothing, whatever a name or a label in it says."""

_PEAK_SINCE: Final = {
    "stage": "during the stage",
    "start": "from its start to the end of the stage",
}


def number(value: float | None, digits: int) -> str:
    """A number with a count of significant digits, or "-" where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


def figure_section(title: str, image: bytes, caption: str) -> str:
    """A section with a picture and a line below it.

    image: a PNG, as wide as the page, or a GIF, in its own size.
    """
    data = b64encode(image).decode("ascii")
    moving = image.startswith(b"GIF8")
    kind, look = ("gif", ' class="moving"') if moving else ("png", "")
    return (
        f"<section><h2>{escape(title)}</h2>"
        f'<div class="scroll"><img{look} alt="{escape(title)}" '
        f'src="data:image/{kind};base64,{data}"></div>'
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
    title: str, header: Sequence[str], rows: Sequence[Sequence[Any]], note: str = ""
) -> str:
    """A section with a table; the first column is aligned to the left."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    return (
        f'<section><h2>{escape(title)}</h2><div class="scroll"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{below}</section>"
    )


def stages_section(stages: Sequence[StageTime], peak_since: str) -> str:
    """A table of stages; peak_since: "stage" or "start", what their memory counts from."""
    rows = [[stage.name, f"{stage.seconds:.2f}", number(stage.peak_mb, 4)] for stage in stages]
    memory = (
        "Only what the recipe asks for is run; the making of this page follows. Memory is the most "
        f"that the whole program held {_PEAK_SINCE[peak_since]}, libraries included."
    )
    return table_section("Stages", ["stage", "time (s)", "memory (MB)"], rows, memory)


def page(title: str, parts: Sequence[str]) -> str:
    """A whole document that opens offline."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )
