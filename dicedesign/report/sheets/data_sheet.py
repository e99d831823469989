"""The data sheet of a die: one page to print and keep with it.

Lengths are in pixels of the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import Final

import numpy as np

from dicedesign.report.charts.palette import ACCENT, FAINT, GRID
from dicedesign.report.charts.paper import NOTE, SMALL, TINY, Picture, text_width
from dicedesign.report.sheets.facts import SheetFacts
from dicedesign.report.sheets.pages import FINE, HEIGHT, WIDTH, Page

__all__ = ["VIEW", "VIEWS", "decoded", "draw_data_sheet", "wrapped"]

VIEWS: Final = 4
"""Pictures in the first row."""

_MARGIN: Final = 80.0

_GAP: Final = 24.0

_NAME: Final = 44

_HEAD: Final = 25
"""Sizes of letters of the name and of headings."""

_LINE: Final = 1.45
"""Height of a line of text, over the size of its letters."""

_SIZES: Final = (SMALL, NOTE, TINY)
"""Sizes of letters of text and table, of which the first that fits is taken."""

_BOTTOM: Final = HEIGHT - 120.0
"""Where text and table end."""

_TEXT_WIDTH: Final = 470.0

_TABLE_LEFT: Final = _MARGIN + _TEXT_WIDTH + 50.0

_RIGHT: Final = WIDTH - _MARGIN

_LEAST_SHARE: Final = 0.4
"""Of its size that a figure may be shown at."""

VIEW: Final = round((_RIGHT - _MARGIN - (VIEWS - 1) * _GAP) / VIEWS)
"""Side of a picture."""


def draw_data_sheet(
    page: Page,
    facts: SheetFacts,
    views: Sequence[tuple[str, Picture]],
    figures: Sequence[Picture] = (),
) -> None:
    """Draw the sheet. A table that is too long ends with how many rows are left out.

    views: `VIEWS` times a line and a picture of `FINE` times `VIEW` pixels a side; figures: to show
    below these where there is room, as wide as the page.
    """
    page.text(facts.title, _MARGIN, 110.0, size=_NAME)
    page.text(facts.subtitle, _MARGIN, 148.0, size=SMALL, color=FAINT)
    page.box(_MARGIN, 166.0, _RIGHT, 169.0, ACCENT)
    top = 186.0
    for place, (line, picture) in enumerate(views):
        left = _MARGIN + place * (VIEW + _GAP)
        page.picture(picture, left, top)
        page.text(line, left + VIEW / 2.0, top + VIEW + 14.0, size=TINY, anchor="m", color=FAINT)
    top += VIEW + 40.0
    needed = max(_text_height(facts.sections, SMALL), _table_height(len(facts.rows), TINY))
    for figure in figures:
        shown = _fitting(figure, _BOTTOM - top - needed)
        if shown is not None:
            height, width = (length / FINE for length in shown.shape[:2])
            page.picture(shown, (WIDTH - width) / 2.0, top)
            top += height + _GAP
    _write_sections(page, facts.sections, top)
    _write_table(page, facts, top)
    page.box(_MARGIN, HEIGHT - 98.0, _RIGHT, HEIGHT - 97.0, GRID)
    page.text(facts.checksum, _MARGIN, HEIGHT - 70.0, size=TINY, color=FAINT)


def _fitting(figure: Picture, room: float) -> Picture | None:
    """A figure as large as it fits below each other, or None where it would be too small."""
    height, width = figure.shape[:2]
    share = min((_RIGHT - _MARGIN) / width, (room - _GAP) / height, 1.0)
    if share < _LEAST_SHARE:
        return None
    return _shrunk(figure, int(FINE * share * width), int(FINE * share * height))


def _shrunk(figure: Picture, width: int, height: int) -> Picture:
    """A picture in another size."""
    from PIL import Image

    image = Image.fromarray(figure).resize((width, height), Image.Resampling.LANCZOS)
    return np.asarray(image)


def wrapped(text: str, width: float, size: int) -> Iterator[str]:
    """The lines of a text of some width; words that are longer are cut."""
    line = ""
    for word in text.split():
        while text_width(word, size) > width:
            kept = next(
                k
                for k in range(len(word) - 1, 0, -1)
                if k == 1 or text_width(word[:k], size) <= width
            )
            if line:
                yield line
                line = ""
            yield word[:kept]
            word = word[kept:]
        longer = f"{line} {word}".strip()
        if text_width(longer, size) > width:
            yield line
            longer = word
        line = longer
    if line:
        yield line


def _section_lines(
    sections: Sequence[tuple[str, Sequence[str]]], size: int
) -> Iterator[tuple[str, int, float]]:
    """Text, size, and room above each line of the text column, paragraphs in letters of a size."""
    for number, (heading, paragraphs) in enumerate(sections):
        yield heading, _HEAD, _LINE * _HEAD + (14.0 if number else -8.0)
        for paragraph in paragraphs:
            above = 6.0
            for line in wrapped(paragraph, _TEXT_WIDTH, size):
                yield line, size, _LINE * size + above
                above = 0.0


def _text_height(sections: Sequence[tuple[str, Sequence[str]]], size: int) -> float:
    return sum(above for *_, above in _section_lines(sections, size))


def _write_sections(page: Page, sections: Sequence[tuple[str, Sequence[str]]], top: float) -> None:
    """Write the text column in letters as large as it fits; what does not ends with where it is."""
    room = _BOTTOM - top
    size = next((s for s in _SIZES if _text_height(sections, s) <= room), TINY)
    fits = _text_height(sections, size) <= room
    base = top
    for line, height, above in _section_lines(sections, size):
        base += above
        if not fits and base > _BOTTOM - 2.0 * _LINE * size:
            page.text("more in result.json", _MARGIN, base, size=size, color=FAINT)
            break
        page.text(line, _MARGIN, base, size=height)


def _table_height(rows: int, size: int) -> float:
    """Of a table with its head and the line below it."""
    return (rows + 3.0) * _LINE * size


def _write_table(page: Page, facts: SheetFacts, top: float) -> None:
    room = _BOTTOM - top
    size = next((s for s in _SIZES if _table_height(len(facts.rows), s) <= room), TINY)
    step = _LINE * size
    most = max(int(room / step) - 3, 1)
    rows = facts.rows if len(facts.rows) <= most else facts.rows[: most - 1]
    count = len(facts.header)
    # The labels are on the left, all numbers end at the right of their columns.
    first = max(text_width(row[0], size) for row in [facts.header, *rows])
    room_of_numbers = _RIGHT - _TABLE_LEFT - first
    ends = [_TABLE_LEFT + first + room_of_numbers * k / (count - 1) for k in range(1, count)]
    head = next(
        (
            s
            for s in (size, TINY, TINY - 2)
            if _widest(facts.header[1:], s) < room_of_numbers / (count - 1) - 8.0
        ),
        TINY - 3,
    )
    base = top + step - 4.0
    _write_row(page, facts.header, ends, base, head, FAINT)
    page.box(_TABLE_LEFT, base + 0.4 * step, _RIGHT, base + 0.4 * step + 1.0, FAINT)
    base += 0.3 * step
    for number, row in enumerate(rows):
        base += step
        if number % 2:
            page.box(
                _TABLE_LEFT - 6.0, base - 0.73 * step, _RIGHT + 6.0, base + 0.27 * step, "#f3f5f7"
            )
        _write_row(page, row, ends, base, size)
    left_out = len(facts.rows) - len(rows)
    for line in ([f"and {left_out} more: see result.json"] if left_out else []) + [facts.remark]:
        base += step
        page.text(line, _TABLE_LEFT, base, size=TINY, color=FAINT)


def _write_row(
    page: Page, row: Sequence[str], ends: Sequence[float], base: float, size: int, color: str = ""
) -> None:
    colors = {"color": color} if color else {}
    page.text(row[0], _TABLE_LEFT, base, size=size, **colors)
    for text, end in zip(row[1:], ends, strict=True):
        page.text(text, end, base, size=size, anchor="r", **colors)


def _widest(texts: Sequence[str], size: int) -> float:
    return max(text_width(text, size) for text in texts)


def decoded(png: bytes) -> Picture:
    """A PNG as a picture."""
    from PIL import Image

    return np.asarray(Image.open(BytesIO(png)).convert("RGB"))
